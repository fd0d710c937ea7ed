import java.io.BufferedReader;
import java.io.IOException;
import java.io.InputStreamReader;
import java.util.ArrayList;
import java.util.List;

/**
 * A bot without memory: all go for the enemy's flag while one of them sees it; until then, they search the enemy's half. It reads a
 * JSON object a line from stdin, and answers each observation with a line on stdout. Debug with System.err.
 */
final class Bot {
    static List<Integer> act(Board seen) {
        int flag = seen.findFlag(seen.ground);
        List<Integer> orders = new ArrayList<>();
        for (Board.Unit unit : seen.units) {
            int goal = flag >= 0 ? flag : searchGoal(unit, seen);
            orders.add(seen.stepTowards(List.of(goal), unit, seen.ground));
        }
        return orders;
    }

    /** Two by two, units go in and out of the enemy's half, further down each time. */
    static int searchGoal(Board.Unit unit, Board seen) {
        int side = seen.side, turn = seen.tick / side;
        int row = (unit.index() / 2 * side / 3 + side / 6 + turn / 2 * 4) % side;
        int depth = turn % 2 == 0 ? side - 2 : side / 2;
        return row * side + (seen.isBlue ? depth : side - 1 - depth);
    }

    public static void main(String[] arguments) throws IOException {
        BufferedReader in = new BufferedReader(new InputStreamReader(System.in));
        for (String line; (line = in.readLine()) != null; ) {
            Object message = Json.read(line);
            if ("observation".equals(Json.get(message, "type"))) System.out.println(act(new Board(message)));
        }
    }
}
