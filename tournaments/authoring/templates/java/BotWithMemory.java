import java.io.BufferedReader;
import java.io.IOException;
import java.io.InputStreamReader;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;

/**
 * A bot with memory: it keeps the ground and the flag that it has seen, and searches where it has not been. It reads a JSON object a
 * line from stdin, and answers each observation with a line on stdout. Debug with System.err.
 */
final class BotWithMemory {
    private int[] ground; // of the match that runs
    private int flag = -1;
    private String log = "";

    List<Integer> act(Board seen) {
        remember(seen);
        List<Integer> unseen = findUnseen(seen), orders = new ArrayList<>();
        for (Board.Unit unit : seen.units) {
            List<Integer> goals = List.of(flag);
            if (flag < 0 || unit.flies()) {
                goals = unseen.stream().filter(cell -> cell / seen.side * seen.units.size() / seen.side == unit.index()).toList();
                if (goals.isEmpty()) goals = unseen;
            }
            orders.add(seen.stepTowards(goals, unit, ground));
        }
        return orders;
    }

    private void remember(Board seen) {
        if (ground == null) {
            ground = new int[seen.ground.length];
            Arrays.fill(ground, Board.HIDDEN);
        }
        for (int cell = 0; cell < ground.length; cell++) if (seen.ground[cell] != Board.HIDDEN) ground[cell] = seen.ground[cell];
        log = "";
        if (flag < 0) {
            flag = seen.findFlag(ground);
            if (flag >= 0) log = "\"found the flag at " + flag / seen.side + ", " + flag % seen.side + "\"";
        }
    }

    /** The cells of the enemy's half that nobody has seen. */
    private List<Integer> findUnseen(Board seen) {
        List<Integer> unseen = new ArrayList<>();
        for (int cell = 0; cell < ground.length; cell++)
            if (ground[cell] == Board.HIDDEN && (cell % seen.side >= seen.side / 2) == seen.isBlue) unseen.add(cell);
        return unseen;
    }

    public static void main(String[] arguments) throws IOException {
        BufferedReader in = new BufferedReader(new InputStreamReader(System.in));
        BotWithMemory bot = new BotWithMemory();
        for (String line; (line = in.readLine()) != null; ) {
            Object message = Json.read(line);
            if ("start".equals(Json.get(message, "type"))) bot = new BotWithMemory();
            if ("observation".equals(Json.get(message, "type"))) {
                List<Integer> orders = bot.act(new Board(message));
                System.out.println("{\"orders\": " + orders + ", \"log\": [" + bot.log + "]}");
            }
        }
    }
}
