/* Anderson's acceleration of rounds of soft pairs. The same as cfem.predict.contact.step.acceleration. */
#include <string.h>

#include "cfem_soft.h"

#define ANSWERS CFEM_MEET_ANSWERS
#define ROWS CFEM_TOUCH_ROWS
#define ROBOTS CFEM_MEET_ROBOTS

enum { FIRST = 3, ACCELERATED = 16 }; /* answers to begin with; rounds that combine them: see cfem.predict.contact.step.rounds */
static const double DEPENDENT = 1e-6, ALIKE = 0.5;

/* Numbers of all robots behind one another: how many. */
static int joined(const cfem_rounds *at, double (*each)[ROWS], double *all) {
    int n = 0;
    for (int b = 0; b < ROBOTS; b++)
        for (int j = 0; j < 3 * at->now[b].count; j++) all[n++] = each[b][j];
    return n;
}

/* Whether a step of n mm goes where that of the last round of the same patches went. It is the last one from here on. */
static int same_way(cfem_answers *answers, int n, const double *step) {
    const double sizes = cfem_dot(n, step, step) * cfem_dot(n, answers->last, answers->last);
    const int same = n == answers->last_moved && cfem_dot(n, step, answers->last) > ALIKE * sqrt(sizes);
    memcpy(answers->last, step, sizeof *step * (size_t)n), answers->last_moved = n;
    return same;
}

/* Begins anew where the rows of the law, their modes or the patches that bear are not those of the answers. */
static void compare(const cfem_rounds *at, int moved, cfem_answers *answers) {
    const int rows = at->solid + at->pairs;
    int same = rows == answers->rows && moved == answers->moved;
    for (int r = 0; r < rows; r++) {
        const int slot = cfem_soft_slot(at, r), mode = cfem_touch_mode(at->mu, at->local[r]);
        same &= slot == answers->slot[r] && mode == answers->mode[r];
        answers->slot[r] = slot, answers->mode[r] = mode;
    }
    answers->rows = rows, answers->moved = moved;
    if (!same) answers->count = 0;
}

/* Behind the others, of which the first one goes where there are too many: its n numbers. */
static double *append(cfem_answers *answers, const double *step) {
    if (answers->count == ANSWERS) {
        answers->count--;
        memmove(answers->pushes[0], answers->pushes[1], sizeof *answers->pushes * (ANSWERS - 1));
        memmove(answers->step[0], answers->step[1], sizeof *answers->step * (ANSWERS - 1));
    }
    memcpy(answers->step[answers->count], step, sizeof *step * (size_t)answers->moved);
    return answers->pushes[answers->count++];
}

/* combined (n,) N: the sum of answers whose steps, summed in the same way, are least. 0, or 1 where there is none. */
static int combine(const cfem_answers *answers, int n, double *combined) {
    const int m = answers->count - 1, moved = answers->moved;
    double by_step[ANSWERS - 1][ROWS * ROBOTS], size[ANSWERS - 1], gram[(ANSWERS - 1) * (ANSWERS - 1)], share[ANSWERS - 1], sign;
    for (int k = 0; k < m; k++) {
        for (int j = 0; j < moved; j++) by_step[k][j] = answers->step[k + 1][j] - answers->step[k][j];
        size[k] = cfem_larger(sqrt(cfem_dot(moved, by_step[k], by_step[k])), 1e-300);
        for (int j = 0; j < moved; j++) by_step[k][j] /= size[k];
        share[k] = cfem_dot(moved, by_step[k], answers->step[m]);
    }
    for (int k = 0; k < m * m; k++) gram[k] = cfem_dot(moved, by_step[k / m], by_step[k % m]) + (k / m == k % m ? DEPENDENT : 0.0);
    if (cfem_eliminate(m, gram, 1, share, &sign)) return 1;
    for (int j = 0; j < n; j++) {
        combined[j] = answers->pushes[m][j];
        for (int k = 0; k < m; k++) combined[j] -= share[k] / size[k] * (answers->pushes[k + 1][j] - answers->pushes[k][j]);
    }
    return 0;
}

void cfem_soft_accelerate(cfem_rounds *at, double (*on)[ROWS], double (*step)[ROWS]) {
    cfem_answers *const answers = &at->soft->room->answers;
    const int rows = at->solid + at->pairs;
    double all[ROWS * (1 + ROBOTS)];
    const int moved = joined(at, step, all);
    at->onwards = same_way(answers, moved, all) && at->pairs;
    if (!at->takes_all) answers->count = 0;
    if (!at->takes_all || !at->pairs || at->iterations >= ACCELERATED || at->moved <= CFEM_SOFT_RESTS * CFEM_PATCH_LENGTH) return;
    compare(at, moved, answers);
    double *const pushes = append(answers, all);
    for (int i = 0; i < 3 * rows; i++) {
        pushes[i] = 0.0;
        for (int a = 0; a < 3; a++) pushes[i] += at->local[i / 3][a] * at->frame[i / 3][a][i % 3];
    }
    joined(at, on, pushes + 3 * rows);
    if (answers->count < FIRST || combine(answers, 3 * rows + moved, all)) return;
    at->takes_all = 0;
    for (int i = 0; i < 3 * rows; i++) at->local[i / 3][i % 3] = cfem_dot(3, at->frame[i / 3][i % 3], all + 3 * (i / 3));
    for (int b = 0, n = 3 * rows; b < ROBOTS; b++)
        for (int j = 0; j < 3 * at->now[b].count; j++) on[b][j] = all[n++];
}
