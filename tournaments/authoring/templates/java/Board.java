import java.util.ArrayDeque;
import java.util.ArrayList;
import java.util.Collection;
import java.util.List;

/** What the arena tells a program, and the way to a cell. A cell is a number, row * side + column. */
final class Board {
    static final int HIDDEN = -1, BLUE_FLAG = 6, RED_FLAG = 7, OBSTACLE = 8;
    private static final int[] DOWN = {0, -1, 0, 1, 0}, RIGHT = {0, 0, 1, 0, -1}; // stay, north, east, south, west

    record Unit(int index, int cell, boolean flies) {}

    final boolean isBlue;
    final int tick, side;
    final int[] ground;
    final List<Unit> units = new ArrayList<>();

    Board(Object message) {
        isBlue = "blue".equals(Json.get(message, "team"));
        tick = Json.number(Json.get(message, "tick"));
        List<?> rows = Json.items(Json.get(message, "ground"));
        side = rows.size();
        ground = rows.stream().flatMap(row -> Json.items(row).stream()).mapToInt(Json::number).toArray();
        for (Object unit : Json.items(Json.get(message, "units"))) {
            int cell = Json.number(Json.get(unit, "row")) * side + Json.number(Json.get(unit, "column"));
            units.add(new Unit(units.size(), cell, Boolean.TRUE.equals(Json.get(unit, "flies"))));
        }
    }

    /** The cell of the enemy's flag, or -1 where it is not on this ground. */
    int findFlag(int[] ground) {
        for (int cell = 0; cell < ground.length; cell++) if (ground[cell] == (isBlue ? RED_FLAG : BLUE_FLAG)) return cell;
        return -1;
    }

    /** The first step of a shortest way to the nearest goal, around obstacles; what is hidden counts as open. */
    int stepTowards(Collection<Integer> goals, Unit unit, int[] ground) {
        boolean[] isReached = new boolean[ground.length];
        for (int goal : goals) isReached[goal] = true;
        if (isReached[unit.cell]) return 0;
        ArrayDeque<Integer> queue = new ArrayDeque<>(goals);
        while (!queue.isEmpty()) {
            int cell = queue.remove();
            for (int order = 1; order <= 4; order++) {
                int row = cell / side - DOWN[order], column = cell % side - RIGHT[order]; // from here, the order leads on
                if (row < 0 || row >= side || column < 0 || column >= side) continue;
                int before = row * side + column;
                if (before == unit.cell) return order;
                if (isReached[before] || (ground[before] == OBSTACLE && !unit.flies)) continue;
                isReached[before] = true;
                queue.add(before);
            }
        }
        return 0;
    }
}
