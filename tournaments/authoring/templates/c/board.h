/* What the arena tells a program, and the way to a cell. A cell is a number, row * side + column. */
#ifndef BOARD_H
#define BOARD_H
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "json.h"

enum { MAX_SIDE = 64, MAX_CELLS = MAX_SIDE * MAX_SIDE, MAX_UNITS = 64 };
enum { HIDDEN = -1, BLUE_FLAG = 6, RED_FLAG = 7, OBSTACLE = 8 };

typedef struct {
    int index, cell, flies;
} Unit;

typedef struct {
    int is_blue, tick, side, n_units;
    int ground[MAX_CELLS];
    Unit units[MAX_UNITS];
} Seen;

/* Read an observation; return 0 if it is none. */
static inline int read_observation(const char *message, Seen *seen) {
    if (!json_is(json_get(message, "type"), "\"observation\"")) return 0;
    seen->is_blue = json_is(json_get(message, "team"), "\"blue\"");
    seen->tick = json_int(json_get(message, "tick"));
    seen->side = seen->n_units = 0;
    const char *ground = json_get(message, "ground");
    for (const char *row = json_first(ground); row != NULL; row = json_next(row)) seen->side++;
    if (seen->side == 0 || seen->side > MAX_SIDE) return 0;
    int cell = 0;
    for (const char *row = json_first(ground); row != NULL; row = json_next(row))
        for (const char *code = json_first(row); code != NULL && cell < seen->side * seen->side; code = json_next(code))
            seen->ground[cell++] = json_int(code);
    const char *unit = json_first(json_get(message, "units"));
    for (; unit != NULL && seen->n_units < MAX_UNITS; unit = json_next(unit)) {
        Unit *one = &seen->units[seen->n_units];
        one->index = seen->n_units++;
        one->cell = json_int(json_get(unit, "row")) * seen->side + json_int(json_get(unit, "column"));
        one->flies = json_is(json_get(unit, "flies"), "true");
    }
    return 1;
}

/* Return the cell of the enemy's flag, or -1 where it is not on the ground. */
static inline int find_flag(const int *ground, const Seen *seen) {
    for (int cell = 0; cell < seen->side * seen->side; cell++)
        if (ground[cell] == (seen->is_blue ? RED_FLAG : BLUE_FLAG)) return cell;
    return -1;
}

/* Return the first step of a shortest way to the nearest goal, around obstacles; what is hidden counts as open. */
static inline int step_towards(const int *goals, int n_goals, const Unit *unit, const int *ground, int side) {
    static const int down[] = {0, -1, 0, 1, 0}, right[] = {0, 0, 1, 0, -1}; /* stay, north, east, south, west */
    char is_reached[MAX_CELLS] = {0};
    int queue[MAX_CELLS], n_reached = 0;
    for (int goal = 0; goal < n_goals; goal++) {
        if (goals[goal] == unit->cell) return 0;
        if (!is_reached[goals[goal]]) is_reached[queue[n_reached++] = goals[goal]] = 1;
    }
    for (int next = 0; next < n_reached; next++)
        for (int order = 1; order <= 4; order++) {
            int row = queue[next] / side - down[order], column = queue[next] % side - right[order]; /* the order leads on */
            int cell = row * side + column;
            if (row < 0 || row >= side || column < 0 || column >= side) continue;
            if (cell == unit->cell) return order;
            if (is_reached[cell] || (ground[cell] == OBSTACLE && !unit->flies)) continue;
            is_reached[queue[n_reached++] = cell] = 1;
        }
    return 0;
}

static inline void print_orders(const int *orders, int n_units) {
    for (int unit = 0; unit < n_units; unit++) printf("%s%d", unit > 0 ? "," : "[", orders[unit]);
    printf("]");
}
#endif
