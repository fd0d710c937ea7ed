/* A bot with memory: it keeps the ground and the flag that it has seen, and searches where it has not been.
   It reads a JSON object a line from stdin, and answers each observation with a line on stdout. Debug on stderr. */
#include "board.h"

static int ground[MAX_CELLS], flag; /* of the match that runs */

static void start(void) {
    for (int cell = 0; cell < MAX_CELLS; cell++) ground[cell] = HIDDEN;
    flag = -1;
}

/* Find the cells of the enemy's half that nobody has seen: in the unit's own rows, or all of them. */
static int find_unseen(const Unit *unit, const Seen *seen, int only_own, int *found) {
    int side = seen->side, n_found = 0;
    for (int cell = 0; cell < side * side; cell++) {
        int is_theirs = (cell % side >= side / 2) == seen->is_blue;
        int is_own = cell / side * seen->n_units / side == unit->index;
        if (ground[cell] == HIDDEN && is_theirs && (is_own || !only_own)) found[n_found++] = cell;
    }
    return n_found;
}

static void act(const Seen *seen, int *orders) {
    for (int cell = 0; cell < seen->side * seen->side; cell++)
        if (seen->ground[cell] != HIDDEN) ground[cell] = seen->ground[cell];
    if (flag < 0) flag = find_flag(ground, seen);
    for (int number = 0; number < seen->n_units; number++) {
        const Unit *unit = &seen->units[number];
        int goals[MAX_CELLS] = {flag}, n_goals = 1;
        if (flag < 0 || unit->flies) {
            n_goals = find_unseen(unit, seen, 1, goals);
            if (n_goals == 0) n_goals = find_unseen(unit, seen, 0, goals);
        }
        orders[number] = step_towards(goals, n_goals, unit, ground, seen->side);
    }
}

int main(void) {
    static Seen seen;
    int orders[MAX_UNITS];
    char *line = NULL;
    size_t capacity = 0;
    while (getline(&line, &capacity, stdin) > 0) {
        if (json_is(json_get(line, "type"), "\"start\"")) start();
        if (!read_observation(line, &seen)) continue;
        int before = flag;
        act(&seen, orders);
        printf("{\"orders\":");
        print_orders(orders, seen.n_units);
        if (before < 0 && flag >= 0) printf(",\"log\":[\"found the flag at %d, %d\"]", flag / seen.side, flag % seen.side);
        printf("}\n");
        fflush(stdout);
    }
    free(line);
    return 0;
}
