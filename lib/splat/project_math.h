/* A Gaussian's way to the screen, sixteen at a time.  Included twice by
 * project_tmpl.c: REAL is a vector of float, or of double (for gradients, whose
 * sums feel a cut-off decided the other way); NAME(x) tells their functions
 * apart. */

/* Sixteen Gaussians on their way to the screen. */
struct NAME(lanes) {
    REAL x, y, z;              /* camera, then pixels and depth */
    REAL xx, xy, yy, det;      /* covariance with the 0.3 */
    REAL fall, square;         /* of struct record; square = root^2 */
    REAL sx, sy;
    vm ok;                     /* in front of the near plane */
};

/* Columns of R(q) diag(s): m[row][column]. */
VEC_INLINE void NAME(factor)(REAL m[3][3], const struct cloud *c, size_t i)
{
    REAL w = NAME(load)(c->quat[0] + i), x = NAME(load)(c->quat[1] + i);
    REAL y = NAME(load)(c->quat[2] + i), z = NAME(load)(c->quat[3] + i);
    REAL s0 = NAME(load)(c->scale[0] + i), s1 = NAME(load)(c->scale[1] + i);
    REAL s2 = NAME(load)(c->scale[2] + i);
    REAL x2 = x + x, y2 = y + y, z2 = z + z;

    m[0][0] = (1 - y2 * y - z2 * z) * s0;
    m[1][0] = (x2 * y + z2 * w) * s0;
    m[2][0] = (x2 * z - y2 * w) * s0;
    m[0][1] = (x2 * y - z2 * w) * s1;
    m[1][1] = (1 - x2 * x - z2 * z) * s1;
    m[2][1] = (y2 * z + x2 * w) * s1;
    m[0][2] = (x2 * z + y2 * w) * s2;
    m[1][2] = (y2 * z - x2 * w) * s2;
    m[2][2] = (1 - x2 * x - y2 * y) * s2;
}

/* cov2d = J W Sigma W^T J^T + 0.3, its determinant without cancellation. */
VEC_INLINE void NAME(ellipse)(struct NAME(lanes) *l, const REAL m[3][3],
                              const struct view *v, REAL iz)
{
    const float *P = v->rt;
    REAL u = NAME(within)(l->x * iz, v->limx);
    REAL t = NAME(within)(l->y * iz, v->limy);
    REAL jx = v->fx * iz, jy = v->fy * iz, a[3], b[3];
    REAL wx[3], wy[3];

    for (int r = 0; r < 3; r++) {
        wx[r] = jx * (P[r] - u * P[8 + r]);
        wy[r] = jy * (P[4 + r] - t * P[8 + r]);
    }
    for (int k = 0; k < 3; k++) {
        a[k] = wx[0] * m[0][k] + wx[1] * m[1][k] + wx[2] * m[2][k];
        b[k] = wy[0] * m[0][k] + wy[1] * m[1][k] + wy[2] * m[2][k];
    }
    REAL c0 = a[1] * b[2] - a[2] * b[1], c1 = a[2] * b[0] - a[0] * b[2];
    REAL c2 = a[0] * b[1] - a[1] * b[0];
    REAL xx = a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
    REAL yy = b[0] * b[0] + b[1] * b[1] + b[2] * b[2];

    l->xy = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    l->det = c0 * c0 + c1 * c1 + c2 * c2 + NAME(literal)(0.3) * (xx + yy) +
             NAME(literal)(0.09);
    l->xx = xx + NAME(literal)(0.3);
    l->yy = yy + NAME(literal)(0.3);
}

VEC_INLINE void NAME(place)(struct NAME(lanes) *l, const struct splat_state *s,
                            size_t i)
{
    const struct view *v = &s->view;
    const float *P = v->rt;
    REAL x = NAME(load)(s->cloud.mean[0] + i);
    REAL y = NAME(load)(s->cloud.mean[1] + i);
    REAL z = NAME(load)(s->cloud.mean[2] + i), c[3], m[3][3];

    for (int r = 0; r < 3; r++)
        c[r] = P[4 * r] * x + P[4 * r + 1] * y +
               (P[4 * r + 2] * z + P[4 * r + 3]);
    l->x = c[0];
    l->y = c[1];
    l->z = c[2];
    l->ok = vf_gt(NAME(narrow)(l->z), vf_set(v->near));
    REAL deep = NAME(pick)(l->ok, l->z), iz = 1 / deep;

    NAME(factor)(m, &s->cloud, i);
    NAME(ellipse)(l, m, v, iz);
    if (v->dgr)
        iz = 1 / (deep + v->eps);
    l->x = v->fx * l->x * iz + v->cx;
    l->y = v->fy * l->y * iz + v->cy;
    l->fall = NAME(literal)(HALF_LOG2E) / l->yy;
    l->square = NAME(literal)(HALF_LOG2E) * l->yy / l->det;
    l->sx = l->xy / l->xx;
    l->sy = l->xy / l->yy;
}

#undef REAL
#undef NAME
