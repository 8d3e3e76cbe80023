/* element_solve.cl: the reflectance of every element for itself, from all candidates of one roughness level.
 *
 * Blocks of sixteen elements in the lanes of a float16, arrays [bin][channel][lane], as in light_field.cl.  For the light
 * that arrives now, the columns X, Y (diffuse) and A, B (specular, of a level) are built bin by bin.  At a fixed level
 *     L_o = d [(1 - F0) X + (1 - F90) Y] + F0 A + F90 B         (phong: L_o = k_d X + k_s A, k_d = d, k_s = F0)
 * is linear in two unknowns x, L_o = p + x1 u + x2 v, and with C = [u v]' W [u v], d = [u v]' W (b - p)
 *     both      x1 = (C22 d1 - C12 d2) / det C,  x2 = (C11 d2 - C21 d1) / det C                              (Eq. 3)
 *     diffuse   x1 = (C11 (d1 - C12 x2) + C21 (d2 - C22 x2)) / (C11^2 + C21^2)                               (Eq. 5)
 *     specular  x2 = (C12 (d1 - C11 x1) + C22 (d2 - C21 x1)) / (C12^2 + C22^2)                               (Eq. 6)
 * Eqs. 5 and 6 are least squares of C x - d; with LEAST it is those of the light, x1 = (d1 - C12 x2) / C11, and both are
 * fitted in turn once more where they are held in bounds.  A price h of moving a parameter adds h to the diagonal of C and h
 * times the present value to d.
 * Nguyen et al. 2013, 5.3 and Listing 1.  Build constants MODEL, LEAST (0 or 1).
 */
#include "reflectance.cl"

#define LANES 16
#define Q_BINS (D_BINS / 4)
#define BASES 5 /* X, Y, A, B and what is wanted, T */
#define BX 0
#define BY 1
#define BA 2
#define BB 3
#define BT 4
#define PRODUCTS 15
#define PARTS 8 /* of the bins, each summed by itself */
#define PRESENT 14
#define PARALLEL 1e-4f /* sine^2 of the angle between u and v below which they say the same */
#define CANDIDATES 4   /* nothing, diffuse, specular, both */
#define ROUNDS 2       /* between diffuse and specular, where bounds hold one of them */

/* X and Y
 * coarse   (blocks, Q, 3) float16 light; e_pi (blocks, 3) float16
 * y        (Q, Q); y_scale (D)
 * columns  (2, blocks, D, 3) float16: result
 */
__kernel void diffuse_columns(__global const float16 *coarse, __global const float16 *e_pi, __global const float *y,
                              __global const float *y_scale, const int blocks, __global float16 *columns)
{
    int q = get_global_id(0), b = get_global_id(1);
    if (q >= Q_BINS) return;
    __global const float16 *light = coarse + (size_t)b * Q_BINS * 3;
    float16 ys[3] = {0.0f, 0.0f, 0.0f};
    for (int k = 0; k < Q_BINS; k++)
        for (int c = 0; c < 3; c++) ys[c] += y[q * Q_BINS + k] * light[k * 3 + c];
    for (int k = 0; k < 4; k++) {
        int d = ((q / (SIDE / 2)) * 2 + k / 2) * SIDE + (q % (SIDE / 2)) * 2 + k % 2;
        for (int c = 0; c < 3; c++) {
            float16 v = ys[c] * y_scale[d];
            columns[((size_t)b * D_BINS + d) * 3 + c] = e_pi[b * 3 + c] - v;
            columns[((size_t)(blocks + b) * D_BINS + d) * 3 + c] = v;
        }
    }
}

/* A and B of a rough level
 * a, b        (Q, Q); lobe_scale (D, 2)
 * columns     (2, blocks, D, 3) float16: result
 */
__kernel void coarse_columns(__global const float16 *coarse, __global const float *a, __global const float *b,
                             __global const float2 *lobe_scale, const int blocks, __global float16 *columns)
{
    int q = get_global_id(0), block = get_global_id(1);
    if (q >= Q_BINS) return;
    __global const float16 *light = coarse + (size_t)block * Q_BINS * 3;
    float16 as[3] = {0.0f, 0.0f, 0.0f}, bs[3] = {0.0f, 0.0f, 0.0f};
    for (int k = 0; k < Q_BINS; k++) {
        float wa = a[q * Q_BINS + k], wb = b[q * Q_BINS + k];
        float16 r = light[k * 3], g = light[k * 3 + 1], bl = light[k * 3 + 2];
        as[0] += wa * r; as[1] += wa * g; as[2] += wa * bl;
        bs[0] += wb * r; bs[1] += wb * g; bs[2] += wb * bl;
    }
    for (int k = 0; k < 4; k++) {
        int d = ((q / (SIDE / 2)) * 2 + k / 2) * SIDE + (q % (SIDE / 2)) * 2 + k % 2;
        for (int c = 0; c < 3; c++) {
            columns[((size_t)block * D_BINS + d) * 3 + c] = as[c] * lobe_scale[d].x;
            columns[((size_t)(blocks + block) * D_BINS + d) * 3 + c] = bs[c] * lobe_scale[d].y;
        }
    }
}

/* A and B of a sharp level
 * light    (blocks, D, 3) float16
 * first    (D + 1) rows of tap, a, b
 */
__kernel void sharp_columns(__global const float16 *light, __global const int *first, __global const ushort *tap,
                            __global const float *a, __global const float *b, const int blocks, __global float16 *columns)
{
    int d = get_global_id(0), block = get_global_id(1);
    if (d >= D_BINS) return;
    float16 as[3], bs[3];
    sharp_row(light + (size_t)block * D_BINS * 3, first[d], first[d + 1], tap, a, b, as, bs);
    for (int c = 0; c < 3; c++) {
        columns[((size_t)block * D_BINS + d) * 3 + c] = as[c];
        columns[((size_t)(blocks + block) * D_BINS + d) * 3 + c] = bs[c];
    }
}

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

/* what is wanted of an element: what its reflectance makes of the light now, and how it is to change.  So emission and
 * coats stay out of it, and the present reflectance explains the present light to the last digit.
 * order      (blocks * 16) element of each lane, -1 for none
 * own        (blocks, 12) float16: weights of the columns now, three channels each
 * xy, ab     (2, blocks, D, 3) float16: columns X and Y, A and B of the own roughness
 * emission   (N, 3); outgoing, wanted (N, D, 3), wanted without emission
 * target     (blocks, D, 3) float16: result
 */
__kernel void take_target(__global const int *order, __global const float16 *own, __global const float16 *xy,
                          __global const float16 *ab, __global const float *emission, __global const light_t *outgoing,
                          __global const float *wanted, const uint blocks, __global float *target)
{
    uint d = get_global_id(0), block = get_global_id(1);
    if (d >= D_BINS || block >= blocks) return;
    size_t one = ((size_t)block * D_BINS + d) * 3, two = ((size_t)(blocks + block) * D_BINS + d) * 3;
    own += block * 12;
    for (int c = 0; c < 3; c++)
        vstore16(own[c] * xy[one + c] + own[3 + c] * xy[two + c] + own[6 + c] * ab[one + c] + own[9 + c] * ab[two + c],
                 one + c, target);
    for (int lane = 0; lane < LANES; lane++) {
        int e = order[block * LANES + lane];
        if (e < 0) continue;
        size_t at = (size_t)e * D_BINS + d;
        float3 more = load3(wanted, at) - load_light(outgoing, at) + load3(emission, e);
        __global float *to = target + one * LANES + lane;
        to[0] += more.x; to[LANES] += more.y; to[2 * LANES] += more.z;
    }
}

/* products of the columns and of what is wanted, summed over a part of the bins
 * target    (blocks, D, 3) float16; weight (blocks, D) float16: the diagonal of W
 * products  (blocks, PARTS, 3, 15) float16: result, X.X X.Y X.A X.B X.T Y.Y Y.A Y.B Y.T A.A A.B A.T B.B B.T T.T
 */
__kernel void take_products(__global const float16 *xy, __global const float16 *ab, __global const float16 *target,
                            __global const float16 *weight, const uint blocks, __global float16 *products)
{
    uint c = get_global_id(0), part = get_global_id(1), block = get_global_id(2);
    if (c >= 3 || part >= PARTS || block >= blocks) return;
    float16 s[PRODUCTS];
    for (int k = 0; k < PRODUCTS; k++) s[k] = 0.0f;
    for (uint d = part * (D_BINS / PARTS); d < (part + 1) * (D_BINS / PARTS); d++) {
        size_t one = ((size_t)block * D_BINS + d) * 3 + c, two = ((size_t)(blocks + block) * D_BINS + d) * 3 + c;
        float16 x = xy[one], y = xy[two], a = ab[one], b = ab[two], t = target[one], w = weight[block * D_BINS + d];
        float16 wx = w * x, wy = w * y, wa = w * a, wb = w * b;
        s[0] += wx * x; s[1] += wx * y; s[2] += wx * a; s[3] += wx * b; s[4] += wx * t;
        s[5] += wy * y; s[6] += wy * a; s[7] += wy * b; s[8] += wy * t;
        s[9] += wa * a; s[10] += wa * b; s[11] += wa * t;
        s[12] += wb * b; s[13] += wb * t; s[14] += w * t * t;
    }
    for (int k = 0; k < PRODUCTS; k++) products[((block * PARTS + part) * 3 + c) * PRODUCTS + k] = s[k];
}

/* u' G v of two combinations of the bases */
inline float form(const float *u, const float *g, const float *v)
{
    float sum = 0.0f;
    for (int i = 0; i < BASES; i++)
        for (int k = 0; k < BASES; k++) sum += u[i] * g[i * BASES + k] * v[k];
    return sum;
}

/* quotients of three channels; one for all where they are to stay alike.  Nothing over nothing is `present` */
inline void divide(const float *over, const float *under, int is_alike, const float *present, float *out)
{
    float o = over[0] + over[1] + over[2], u = under[0] + under[1] + under[2];
    for (int c = 0; c < 3; c++) {
        float below = is_alike ? u : under[c];
        out[c] = below > 0.0f ? (is_alike ? o : over[c]) / below : present[c];
    }
}

/* from zero up, and scaled down where any channel passes its highest value, which keeps the hue */
inline void scale_into(float *color, const float *top)
{
    float s = 1.0f;
    for (int c = 0; c < 3; c++) {
        color[c] = max(color[c], 0.0f);
        if (color[c] > top[c]) s = min(s, top[c] / color[c]);
    }
    for (int c = 0; c < 3; c++) color[c] *= s;
}

/* What an element is: d, F0, F90 of three channels each; whether F90 follows F0, and whether F0 is one for all channels;
 * the highest d; prices of moving d and F0 by one.  g: symmetric products (3, 5, 5). */
#define D0 now
#define F0 (now + 3)
#define F90 (now + 6)
#define IS_TIED (now[9] > 0.5f)
#define IS_ALIKE (now[10] > 0.5f)
#define HIGHEST now[11]
#define HOLD_D now[12]
#define HOLD_F now[13]

/* diffuse with a specular reflectance f (Eq. 5) */
inline void fit_diffuse(const float *g, const float *now, const float *f, float *d)
{
    float over[3], under[3], top[3];
    for (int c = 0; c < 3; c++, g += BASES * BASES) {
        float at_90 = !HAS_FRESNEL ? 0.0f : IS_TIED ? f[c] : F90[c];
        float u[BASES] = {!HAS_FRESNEL ? 1.0f : 1.0f - f[c], !HAS_FRESNEL ? 0.0f : 1.0f - at_90, 0.0f, 0.0f, 0.0f};
        float v[BASES] = {0.0f, 0.0f, 1.0f, IS_TIED, 0.0f}, p[BASES] = {0.0f, 0.0f, 0.0f, IS_TIED ? 0.0f : at_90, -1.0f};
        float c11 = form(u, g, u), c12 = form(u, g, v), c22 = form(v, g, v);
        float e1 = -form(u, g, p) - c12 * f[c], e2 = -form(v, g, p) - c22 * f[c];
        over[c] = LEAST ? e1 + HOLD_D * D0[c] : c11 * e1 + c12 * e2;
        under[c] = LEAST ? c11 + HOLD_D : c11 * c11 + c12 * c12;
        top[c] = max(!HAS_FRESNEL ? min(HIGHEST, 1.0f - f[c]) : HIGHEST, D0[c]);
    }
    divide(over, under, 0, D0, d);
    scale_into(d, top);
}

/* specular with a diffuse reflectance d (Eq. 6) */
inline void fit_specular(const float *g, const float *now, const float *d, float *f)
{
    float over[3], under[3], top[3];
    for (int c = 0; c < 3; c++, g += BASES * BASES) {
        float kept = IS_TIED || !HAS_FRESNEL ? 0.0f : F90[c], less = !HAS_FRESNEL ? 0.0f : -d[c];
        float u[BASES] = {1.0f, IS_TIED, 0.0f, 0.0f, 0.0f}, v[BASES] = {less, IS_TIED ? less : 0.0f, 1.0f, IS_TIED, 0.0f};
        float p[BASES] = {0.0f, IS_TIED || !HAS_FRESNEL ? 0.0f : d[c] * (1.0f - kept), 0.0f, kept, -1.0f};
        float c11 = form(u, g, u), c12 = form(u, g, v), c22 = form(v, g, v);
        float e1 = -form(u, g, p) - c11 * d[c], e2 = -form(v, g, p) - c12 * d[c];
        over[c] = LEAST ? e2 + HOLD_F * F0[c] : c12 * e1 + c22 * e2;
        under[c] = LEAST ? c22 + HOLD_F : c12 * c12 + c22 * c22;
        top[c] = !HAS_FRESNEL ? max(1.0f - d[c], 0.0f) : 1.0f;
    }
    divide(over, under, IS_ALIKE, F0, f);
    scale_into(f, top);
}

/* both (Eq. 3), in x = (d (1 - F0), F0) or (k_d, k_s), x1 taken out; 0 where u and v say the same: one parameter says it all */
inline int fit_both(const float *g, const float *now, float *d, float *f)
{
    float over[3], under[3], c11[3], c12[3], d1[3], top[3], most = 1.0f;
    for (int c = 0; c < 3; c++, g += BASES * BASES) {
        float kept = IS_TIED || !HAS_FRESNEL ? 0.0f : F90[c];
        float u[BASES] = {1.0f, IS_TIED, 0.0f, 0.0f, 0.0f}, v[BASES] = {0.0f, 0.0f, 1.0f, IS_TIED, 0.0f};
        float p[BASES] = {0.0f, IS_TIED || !HAS_FRESNEL ? 0.0f : D0[c] * (1.0f - kept), 0.0f, kept, -1.0f};
        c11[c] = form(u, g, u) + HOLD_D;
        c12[c] = form(u, g, v);
        d1[c] = HOLD_D * D0[c] * (!HAS_FRESNEL ? 1.0f : 1.0f - F0[c]) - form(u, g, p);
        float c22 = form(v, g, v) + HOLD_F, d2 = HOLD_F * F0[c] - form(v, g, p);
        float det = c11[c] * c22 - c12[c] * c12[c];
        if (!(det > PARALLEL * c11[c] * c22)) return 0;
        over[c] = d2 - c12[c] * d1[c] / c11[c];
        under[c] = det / c11[c];
    }
    divide(over, under, IS_ALIKE, F0, f);
    for (int c = 0; c < 3; c++) {
        d[c] = max((d1[c] - c12[c] * f[c]) / c11[c], 0.0f);
        f[c] = max(f[c], 0.0f);
        most = max(most, d[c] + f[c]); /* no more than arrives */
        top[c] = max(HIGHEST, D0[c]);
    }
    for (int c = 0; c < 3; c++) {
        d[c] /= most;
        f[c] /= most;
        if (HAS_FRESNEL) d[c] = f[c] < 1.0f ? d[c] / (1.0f - f[c]) : 0.0f;
    }
    scale_into(d, top);
    return 1;
}

/* all candidates of one level, one work-item an element
 * products    (blocks, PARTS, 3, 15, 16)
 * present     (blocks, 14, 16): see above
 * candidates  (blocks, CANDIDATES, 7, 16): d, F0 and what bars it, 0 or infinity
 * columns     (blocks, CANDIDATES, 12, 16): weights of X, Y, A, B, three channels each
 * square      (blocks * 16): T.T over all channels
 */
__kernel void fit_level(__global const float *products, __global const float *present, const uint blocks,
                        __global float *candidates, __global float *columns, __global float *square)
{
    uint i = get_global_id(0);
    if (i >= blocks * LANES) return;
    uint block = i / LANES, lane = i % LANES;
    float now[PRESENT];
    for (int k = 0; k < PRESENT; k++) now[k] = present[(block * PRESENT + k) * LANES + lane];

    float g[3 * BASES * BASES];
    for (int c = 0; c < 3; c++) {
        float sum[PRODUCTS];
        for (int k = 0; k < PRODUCTS; k++) sum[k] = 0.0f;
        for (int part = 0; part < PARTS; part++)
            for (int k = 0; k < PRODUCTS; k++)
                sum[k] += products[(((block * PARTS + part) * 3 + c) * PRODUCTS + k) * LANES + lane];
        for (int k = 0, n = 0; k < BASES; k++)
            for (int l = k; l < BASES; l++, n++) g[(c * BASES + k) * BASES + l] = g[(c * BASES + l) * BASES + k] = sum[n];
    }
    square[i] = g[BASES * BASES - 1] + g[2 * BASES * BASES - 1] + g[3 * BASES * BASES - 1];

    float d[CANDIDATES][3], f[CANDIDATES][3];
    for (int k = 0; k < CANDIDATES; k++)
        for (int c = 0; c < 3; c++) d[k][c] = D0[c], f[k][c] = F0[c];
    fit_diffuse(g, now, F0, d[1]);
    fit_specular(g, now, D0, f[2]);
    float bar = fit_both(g, now, d[3], f[3]) ? 0.0f : INFINITY;
    for (int round = 0; LEAST && round < ROUNDS; round++) {
        fit_diffuse(g, now, f[3], d[3]);
        fit_specular(g, now, d[3], f[3]);
    }
    for (int k = 0; k < CANDIDATES; k++) {
        __global float *to = candidates + (block * CANDIDATES + k) * 7 * LANES + lane;
        __global float *weights = columns + (block * CANDIDATES + k) * 12 * LANES + lane;
        for (int c = 0; c < 3; c++) {
            float dd = d[k][c], ff = f[k][c], at_90 = IS_TIED ? ff : F90[c];
            to[c * LANES] = dd;
            to[(3 + c) * LANES] = ff;
            weights[c * LANES] = !HAS_FRESNEL ? dd : dd * (1.0f - ff);
            weights[(3 + c) * LANES] = !HAS_FRESNEL ? 0.0f : dd * (1.0f - at_90);
            weights[(6 + c) * LANES] = ff;
            weights[(9 + c) * LANES] = !HAS_FRESNEL ? 0.0f : at_90;
        }
        to[6 * LANES] = k == 3 ? bar : 0.0f;
    }
}

/* what each candidate leaves in a part of the bins, from its own radiance: differences of large sums would drown small ones
 * left  (blocks, PARTS, CANDIDATES) float16: result, r' W r
 */
__kernel void take_residuals(__global const float16 *xy, __global const float16 *ab, __global const float16 *target,
                             __global const float16 *weight, __global const float16 *columns, const uint blocks,
                             __global float16 *left)
{
    uint part = get_global_id(0), block = get_global_id(1);
    if (part >= PARTS || block >= blocks) return;
    columns += block * CANDIDATES * 12;
    float16 sum[CANDIDATES];
    for (int k = 0; k < CANDIDATES; k++) sum[k] = 0.0f;
    for (int c = 0; c < 3; c++)
        for (uint d = part * (D_BINS / PARTS); d < (part + 1) * (D_BINS / PARTS); d++) {
            size_t one = ((size_t)block * D_BINS + d) * 3 + c, two = ((size_t)(blocks + block) * D_BINS + d) * 3 + c;
            float16 x = xy[one], y = xy[two], a = ab[one], b = ab[two], t = target[one], w = weight[block * D_BINS + d];
            for (int k = 0; k < CANDIDATES; k++) {
                __global const float16 *p = columns + k * 12 + c;
                float16 r = p[0] * x + p[3] * y + p[6] * a + p[9] * b - t;
                sum[k] += w * r * r;
            }
        }
    for (int k = 0; k < CANDIDATES; k++) left[(block * PARTS + part) * CANDIDATES + k] = sum[k];
}

/* the table of candidates, row by row of levels
 * candidates  (blocks, CANDIDATES, 7, 16); left (blocks, PARTS, CANDIDATES, 16)
 * table       (blocks * 16, levels, CANDIDATES, 7): result, d, F0 and the residual
 */
__kernel void put_level(__global const float *candidates, __global const float *left, const uint blocks,
                        const uint level, const uint levels, __global float *table)
{
    uint i = get_global_id(0);
    if (i >= blocks * LANES) return;
    uint block = i / LANES, lane = i % LANES;
    for (int k = 0; k < CANDIDATES; k++) {
        __global const float *from = candidates + (block * CANDIDATES + k) * 7 * LANES + lane;
        __global float *to = table + ((i * levels + level) * CANDIDATES + k) * 7;
        for (int n = 0; n < 7; n++) to[n] = from[n * LANES];
        for (int part = 0; part < PARTS; part++) to[6] += left[((block * PARTS + part) * CANDIDATES + k) * LANES + lane];
    }
}
