/* element_solve.cl: the reflectance of every element for itself, from all candidates of one roughness level.
 *
 * Arrays of a block are [bin][channel][lane], sixteen elements a block, as in light_field.cl.  At a fixed level
 *     L_o = d [(1 - F0) X + (1 - F90) Y] + F0 A + F90 B         (phong: L_o = k_d X + k_s A, k_d = d, k_s = F0)
 * is linear in two unknowns x, L_o = p + x1 u + x2 v, and with C = [u v]' W [u v], d = [u v]' W (b - p)
 *     both      x1 = (C22 d1 - C12 d2) / det C,  x2 = (C11 d2 - C21 d1) / det C                              (Eq. 3)
 *     diffuse   x1 = (C11 (d1 - C12 x2) + C21 (d2 - C22 x2)) / (C11^2 + C21^2)                               (Eq. 5)
 *     specular  x2 = (C12 (d1 - C11 x1) + C22 (d2 - C21 x1)) / (C12^2 + C22^2)                               (Eq. 6)
 * Nguyen et al. 2013, 5.3 and Listing 1.  Build constant PHONG (0 or 1).
 */
#include "common.cl"

#define LANES 16
#define BX 0
#define BA 1
#define BY 2
#define BB 3
#if PHONG
#define BASES 2
#else
#define BASES 4
#endif
#define PARALLEL 1e-4f /* sine^2 of the angle between u and v below which they say the same */
#define CANDIDATES 4   /* nothing, diffuse, specular, both */

/* columns between two levels, one work-item a bin of a block
 * ab     (2, blocks, D, 3) float16: of one level
 * share  (blocks) float16: of this level in the roughness of each element
 * own    (2, blocks, D, 3) float16: added to
 */
__kernel void add_share(__global const float16 *ab, __global const float16 *share, const uint blocks, __global float16 *own)
{
    uint d = get_global_id(0), block = get_global_id(1);
    if (d >= D_BINS || block >= blocks) return;
    for (uint k = 0; k < 2; k++)
        for (uint c = 0; c < 3; c++) {
            size_t at = ((size_t)(k * blocks + block) * D_BINS + d) * 3 + c;
            own[at] += share[block] * ab[at];
        }
}

/* u' G v of two combinations of the bases */
inline float form(const float *u, const float *gram, const float *v)
{
    float sum = 0.0f;
    for (int i = 0; i < BASES; i++)
        for (int k = 0; k < BASES; k++) sum += u[i] * gram[i * BASES + k] * v[k];
    return sum;
}

/* u' (h - G p) */
inline float wanted_along(const float *u, const float *gram, const float *h, const float *p)
{
    float sum = 0.0f;
    for (int i = 0; i < BASES; i++) {
        float r = h[i];
        for (int k = 0; k < BASES; k++) r -= gram[i * BASES + k] * p[k];
        sum += u[i] * r;
    }
    return sum;
}

/* all candidates of one level, one work-item an element
 * xy, ab     (2, blocks, D, 3, 16) columns X and Y, A and B (element_fit.cl)
 * wanted     (blocks, D, 3, 16) without emission and coat
 * weight     (blocks, D, 16) the diagonal of W
 * present    (blocks, 10, 16): d, F0, F90 of three channels each, and whether F90 follows F0
 * out        (blocks * 16, CANDIDATES, 7): d, F0 and the residual r' W r
 */
__kernel void fit_level(__global const float *xy, __global const float *ab, __global const float *wanted,
                        __global const float *weight, __global const float *present, const uint blocks,
                        __global float *out)
{
    uint i = get_global_id(0);
    if (i >= blocks * LANES) return;
    uint block = i / LANES, lane = i % LANES;
    size_t second = (size_t)blocks * D_BINS * 3 * LANES; /* from X to Y, from A to B */
    __global const float *x = xy, *a = ab;
#if !PHONG
    __global const float *y = xy + second, *b = ab + second;
#endif
    int tied = present[(block * 10 + 9) * LANES + lane] > 0.5f;
    float residual[CANDIDATES] = {0.0f, 0.0f, 0.0f, 0.0f};
    for (int c = 0; c < 3; c++) {
        float d0 = present[(block * 10 + c) * LANES + lane];
        float f0 = present[(block * 10 + 3 + c) * LANES + lane];
        float g = tied ? 0.0f : present[(block * 10 + 6 + c) * LANES + lane];
        float d[CANDIDATES] = {d0, d0, d0, d0}, f[CANDIDATES] = {f0, f0, f0, f0};
        int is_open = 1;

        /* the inner products of the bases, and of the bases with what is wanted, summed row by row of bins */
        float gram[BASES * BASES], h[BASES];
        for (int k = 0; k < BASES * BASES; k++) gram[k] = 0.0f;
        for (int k = 0; k < BASES; k++) h[k] = 0.0f;
        for (int row = 0; row < SIDE; row++) {
            float gram_of_row[BASES * BASES], h_of_row[BASES];
            for (int k = 0; k < BASES * BASES; k++) gram_of_row[k] = 0.0f;
            for (int k = 0; k < BASES; k++) h_of_row[k] = 0.0f;
            for (int column = 0; column < SIDE; column++) {
                size_t bin = (size_t)block * D_BINS + row * SIDE + column;
                size_t at = (bin * 3 + c) * LANES + lane;
                float w = weight[bin * LANES + lane], base[BASES];
                base[BA] = a[at];
                base[BX] = x[at];
#if !PHONG
                base[BB] = tied ? 0.0f : b[at];
                base[BA] = tied ? a[at] + b[at] : a[at];
                base[BY] = tied ? 0.0f : y[at];
                base[BX] = tied ? x[at] + y[at] : x[at];
#endif
                for (int k = 0; k < BASES; k++) {
                    h_of_row[k] += w * base[k] * wanted[at];
                    for (int l = 0; l < BASES; l++) gram_of_row[k * BASES + l] += w * base[k] * base[l];
                }
            }
            for (int k = 0; k < BASES * BASES; k++) gram[k] += gram_of_row[k];
            for (int k = 0; k < BASES; k++) h[k] += h_of_row[k];
        }

        /* both: in x = (d (1 - F0), F0), or (k_d, k_s) */
        float u[BASES], v[BASES], p[BASES];
        for (int k = 0; k < BASES; k++) u[k] = v[k] = p[k] = 0.0f;
        u[BX] = 1.0f;
        v[BA] = 1.0f;
#if !PHONG
        p[BB] = g;
        p[BY] = tied ? 0.0f : d0 * (1.0f - g);
#endif
        float c11 = form(u, gram, u), c12 = form(u, gram, v), c22 = form(v, gram, v);
        float d1 = wanted_along(u, gram, h, p), d2 = wanted_along(v, gram, h, p);
        float det = c11 * c22 - c12 * c12;
        if (det > PARALLEL * c11 * c22) {
            float x1 = max((c22 * d1 - c12 * d2) / det, 0.0f), x2 = max((c11 * d2 - c12 * d1) / det, 0.0f);
            float s = 1.0f / max(x1 + x2, 1.0f); /* no more than arrives */
            x1 *= s;
            x2 *= s;
            f[3] = x2;
#if PHONG
            d[3] = x1;
#else
            d[3] = x2 < 1.0f ? min(x1 / (1.0f - x2), 1.0f) : 0.0f;
#endif
        } else
            is_open = 0;

        /* specular, the diffuse reflectance as it is */
#if !PHONG
        v[BX] = -d0;
        c12 = form(u, gram, v);
        c22 = form(v, gram, v);
        d2 = wanted_along(v, gram, h, p);
#endif
        float below = c12 * c12 + c22 * c22;
        float top = PHONG ? max(1.0f - d0, 0.0f) : 1.0f;
        if (below > 0.0f) f[2] = clamp((c12 * (d1 - c11 * d0) + c22 * (d2 - c12 * d0)) / below, 0.0f, top);

        /* diffuse, the specular reflectance as it is */
#if !PHONG
        v[BX] = 0.0f;
        u[BX] = 1.0f - f0;
        u[BY] = tied ? 0.0f : 1.0f - g;
        p[BY] = 0.0f;
        c11 = form(u, gram, u);
        c12 = form(u, gram, v);
        c22 = form(v, gram, v);
        d1 = wanted_along(u, gram, h, p);
        d2 = wanted_along(v, gram, h, p);
#endif
        below = c11 * c11 + c12 * c12;
        top = PHONG ? max(1.0f - f0, 0.0f) : 1.0f;
        if (below > 0.0f) d[1] = clamp((c11 * (d1 - c12 * f0) + c12 * (d2 - c22 * f0)) / below, 0.0f, top);

        /* what each candidate leaves, from its own radiance: differences of large sums would drown small residuals */
        float left[CANDIDATES] = {0.0f, 0.0f, 0.0f, 0.0f};
        for (int row = 0; row < SIDE; row++) {
            float left_of_row[CANDIDATES] = {0.0f, 0.0f, 0.0f, 0.0f};
            for (int column = 0; column < SIDE; column++) {
                size_t bin = (size_t)block * D_BINS + row * SIDE + column;
                size_t at = (bin * 3 + c) * LANES + lane;
                float w = weight[bin * LANES + lane], b_ = wanted[at];
                for (int k = 0; k < CANDIDATES; k++) {
#if PHONG
                    float r = d[k] * x[at] + f[k] * a[at] - b_;
#else
                    float r = tied ? d[k] * (1.0f - f[k]) * (x[at] + y[at]) + f[k] * (a[at] + b[at]) - b_
                                   : d[k] * ((1.0f - f[k]) * x[at] + (1.0f - g) * y[at]) + f[k] * a[at] + g * b[at] - b_;
#endif
                    left_of_row[k] += w * r * r;
                }
            }
            for (int k = 0; k < CANDIDATES; k++) left[k] += left_of_row[k];
        }
        for (int k = 0; k < CANDIDATES; k++) {
            residual[k] += left[k];
            out[(i * CANDIDATES + k) * 7 + c] = d[k];
            out[(i * CANDIDATES + k) * 7 + 3 + c] = f[k];
        }
        if (!is_open) residual[3] = INFINITY; /* u and v say the same: one parameter says it all */
    }
    for (int k = 0; k < CANDIDATES; k++) out[(i * CANDIDATES + k) * 7 + 6] = residual[k];
}
