/* How the built-in head's mesh is woven: which vertex lies where in its grid
 * and in the loops around eye, mouth, ear and nostril.
 *
 * A grid wraps half the head: column 0 is the front midline, column COLS the
 * back midline, row 0 the cut neck, row ROWS the rim of the crown.  Blocks of
 * cells are cut out for eye, mouth, ear and nostril and filled with concentric
 * rings of as many vertices as the block's border has.  Vertices of the left
 * half come first, then the mirror images of those off the midline. */
#ifndef SPID_LAB_HEAD_LOOPS_H
#define SPID_LAB_HEAD_LOOPS_H

enum {
    COLS = 32, ROWS = 43,
    CAP = 8,                                   /* crown: CAP x 2 CAP cells */
    EYE_C0 = 3, EYE_C1 = 13, EYE_R0 = 28, EYE_R1 = 36,
    EYE_N = 2 * (EYE_C1 - EYE_C0 + EYE_R1 - EYE_R0),         /* 36 */
    EYE_RINGS = 9, EYE_MARGIN = 7, EYE_INNER = 8,
    MOUTH_C1 = 9, MOUTH_R0 = 12, MOUTH_R1 = 20,
    MOUTH_N = 2 * MOUTH_C1 + MOUTH_R1 - MOUTH_R0,            /* 26 cells */
    MOUTH_CORNER = MOUTH_N / 2,
    MOUTH_RINGS = 11, LIP_BORDER = 5, LIP_INNER = 9,
    EAR_C0 = 15, EAR_C1 = 20, EAR_R0 = 20, EAR_R1 = 32,
    EAR_N = 2 * (EAR_C1 - EAR_C0 + EAR_R1 - EAR_R0),         /* 34 */
    EAR_RINGS = 11,
    NOS_C0 = 1, NOS_C1 = 3, NOS_R0 = 21, NOS_R1 = 23,
    NOS_N = 8, NOS_RINGS = 3,
    BALL_RINGS = 9, BALL_N = 18,
    LOOPS_HALF = 2629, LOOPS_VERTICES = 5140
};

enum loops_part {
    PART_GRID, PART_CAP, PART_EYE, PART_MOUTH, PART_EAR, PART_NOSTRIL,
    PART_BALL
};

struct loops {
    int nv;                       /* vertices of the left half */
    unsigned char part[LOOPS_HALF], ring[LOOPS_HALF], seam[LOOPS_HALF];
    short row[LOOPS_HALF];        /* of the grid */
    int mirror[LOOPS_VERTICES];   /* the vertex at (-x, y, z) */
    int grid[ROWS + 1][COLS + 1]; /* -1 inside a block */
    int eye[EYE_RINGS + 1][EYE_N];
    int mouth[MOUTH_RINGS + 1][MOUTH_N + 1];
    int ear[EAR_RINGS + 1][EAR_N];
    int nostril[NOS_RINGS + 1][NOS_N];
    int ball_first;               /* first vertex of the eyeball: front pole */
};

/* Fill l. */
void loops_make(struct loops *l);

#endif
