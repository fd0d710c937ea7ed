/* A bot without memory: all go for the enemy's flag while one of them sees it; until then, they search the enemy's half.
   It reads a JSON object a line from stdin, and answers each observation with a line on stdout. Debug on stderr. */
#include "board.h"

/* Two by two, units go in and out of the enemy's half, further down each time. */
static int search_goal(const Unit *unit, const Seen *seen) {
    int side = seen->side, turn = seen->tick / side;
    int row = (unit->index / 2 * side / 3 + side / 6 + turn / 2 * 4) % side;
    int depth = turn % 2 == 0 ? side - 2 : side / 2;
    return row * side + (seen->is_blue ? depth : side - 1 - depth);
}

static void act(const Seen *seen, int *orders) {
    int flag = find_flag(seen->ground, seen);
    for (int unit = 0; unit < seen->n_units; unit++) {
        int goal = flag >= 0 ? flag : search_goal(&seen->units[unit], seen);
        orders[unit] = step_towards(&goal, 1, &seen->units[unit], seen->ground, seen->side);
    }
}

int main(void) {
    static Seen seen;
    int orders[MAX_UNITS];
    char *line = NULL;
    size_t capacity = 0;
    while (getline(&line, &capacity, stdin) > 0)
        if (read_observation(line, &seen)) {
            act(&seen, orders);
            print_orders(orders, seen.n_units);
            printf("\n");
            fflush(stdout);
        }
    free(line);
    return 0;
}
