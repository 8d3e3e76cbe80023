/* live_combine.cl: from columns of light to a picture.
 *
 *     guide_rows     what neighbours are compared by
 *     mean_columns   columns of all frames so far, to light (rows, LIGHT): X, Y, A, B, coat
 *     find_alike     neighbours that show the same surface the same way
 *     filter_light   along one axis, over these
 *     shade          light and colours to radiance, row by row
 *     combine        rows to pixels
 *     find_edges     pixels that one sample is not enough for
 *
 * In a window of the size of the tile that shares a set of numbers each of them occurs once, so a box is the right shape: flat areas
 * come out without any noise.  A neighbour counts where it shows the same material, lies in the same plane and looks the same way; for
 * specular light, where its mirror direction differs by less than the lobe is wide, so that sharp reflections stay sharp.  Where that
 * is less than the window, a part of the tile would be left out, and the place in the tile would show as a pattern: there the tile is
 * smaller, and so is the window.  A tile of even width has no middle: windows reach as far to both sides, and the two places at their
 * ends, which draw the same numbers, count half each; else all light would lie half a place beside where it falls.
 *
 * Guides: position, how far neighbours may lie off its plane, normal, class (negative: nothing), mirror direction, alpha, tile, width.
 */
#include "live_records.cl"

/* size_per_distance: of a pixel, for one unit of distance; or, where it is negative, its size
 * radiance (rows, 3): 0 where nothing is seen */
__kernel void guide_rows(
    const uint count, __global const float *surfaces, __global const float *distance, const float size_per_distance,
    __global float *guide, __global float *radiance)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    __global const float *s = surfaces + i * SURFACE;
    __global float *out = guide + i * GUIDE;
    out[G_CLASS] = -1.0f;
    if (s[MATERIAL] < 0.0f) {
        store3((float3)(0.0f), radiance, i);
        return;
    }
    float3 n = row3(s, NORMAL), v = row3(s, VIEW);
    float lean = larger(inner(row3(s, GEOMETRIC), v), 0.05f);
    float pixel = size_per_distance < 0.0f ? -size_per_distance : size_per_distance * distance[i];
    put3(row3(s, POSITION), out, 0);
    out[G_GAP] = pixel * (0.5f + 0.1f / lean);
    put3(n, out, G_NORMAL);
    out[G_CLASS] = 2.0f * s[MATERIAL] + (largest(row3(s, DIFFUSE)) > 0.0f ? 0.0f : 1.0f);
    put3(2.0f * inner(n, v) * n - v, out, G_MIRROR);
    out[G_ALPHA] = s[ALPHA];
    out[G_TILE] = TILE;
    out[G_WIDTH] = lesser(LOBE_WIDTH * s[ALPHA], WIDEST);
}

/* share of the column Y in even light: fresnel (FRESNEL_COSINES) by the cosine of the eye */
inline float share_of_y(__global const float *s, __global const float *fresnel)
{
    float cosine = within(inner(row3(s, NORMAL), row3(s, VIEW)), 0.0f, 1.0f) * (FRESNEL_COSINES - 1);
    int k = lesser((int)cosine, FRESNEL_COSINES - 2);
    return fresnel[k] + (cosine - k) * (fresnel[k + 1] - fresnel[k]);
}

/* how much of what was known before a frame was gathered still counts after some */
inline float known_share(float frames)
{
    float old = KNOWN_FRAMES / (frames + KNOWN_FRAMES);
    return old * old;
}

/* columns (rows, COLUMNS) are sums of FRAMES frames; soft (rows, 3): diffuse light of the elements, which has the weight that
 * gathered light has not yet; fresnel (FRESNEL): share of the column Y by the cosine of the eye */
__kernel void mean_columns(
    const uint count, __global const uint *rows, __global const float *surfaces, __global const float *columns,
    __global const float *soft, __global const float *fresnel, __global float *light)
{
    size_t at = get_global_id(0);
    if (at >= count) return;
    size_t i = rows[at];
    __global const float *c = columns + i * COLUMNS;
    __global const float *s = surfaces + i * SURFACE;
    __global float *out = light + i * LIGHT;
    float f = 1.0f / larger(c[FRAMES], 1.0f), old = known_share(c[GATHERED]);
    float g = (1.0f - old) / larger(c[GATHERED], 1.0f);
    float3 known = old * load3(soft, i);
    float y = share_of_y(s, fresnel);
    put3(f * row3(c, 0) + g * row3(c, 6) + (1.0f - y) * known, out, 0);
    put3(f * row3(c, 3) + g * row3(c, 9) + y * known, out, 3);
    for (int k = 12; k < 21; k++) out[k - 6] = f * c[k];
    out[15] = c[FRAMES];
}

/* whether neighbours show the same surface as a guide's row a, in the same plane and much the same normal; and whether they mirror
 * what it does; F, I: of one, or of eight side by side */
#define DEFINE_ALIKE(F, I)                                                                                                  \
    OVERLOADED I is_alike(float16 a, F x, F y, F z, F nx, F ny, F nz, F kind, I is_same)                                    \
    {                                                                                                                       \
        F off = fabs((x - a.s0) * a.s4 + (y - a.s1) * a.s5 + (z - a.s2) * a.s6), turned = nx * a.s4 + ny * a.s5 + nz * a.s6; \
        return (kind == a.s7) & (is_same | (turned >= NORMAL_COSINE)) & (off <= a.s3);                                      \
    }                                                                                                                       \
    OVERLOADED I mirrors_alike(float16 a, float wide, F mx, F my, F mz, F alpha)                                            \
    {                                                                                                                       \
        F dx = mx - a.s8, dy = my - a.s9, dz = mz - a.sa;                                                                   \
        return (dx * dx + dy * dy + dz * dz <= wide * wide) & (fabs(alpha - a.sb) <= 0.15f * a.sb);                         \
    }
DEFINE_ALIKE(float, int)
DEFINE_ALIKE(float8, int8)

/* four columns of eight rows side by side: a transposition of loads */
inline void columns_of(__global const float *row, const int *at, float8 *c0, float8 *c1, float8 *c2, float8 *c3)
{
#define PAIR(j) (float8)(vload4(0, row + at[j]), vload4(0, row + at[j + 4]))
    float8 a = PAIR(0), b = PAIR(1), c = PAIR(2), d = PAIR(3);
    float8 ab = (float8)(a.s0, b.s0, a.s1, b.s1, a.s4, b.s4, a.s5, b.s5), cd = (float8)(c.s0, d.s0, c.s1, d.s1, c.s4, d.s4, c.s5, d.s5);
    *c0 = (float8)(ab.s01, cd.s01, ab.s45, cd.s45);
    *c1 = (float8)(ab.s23, cd.s23, ab.s67, cd.s67);
    ab = (float8)(a.s2, b.s2, a.s3, b.s3, a.s6, b.s6, a.s7, b.s7);
    cd = (float8)(c.s2, d.s2, c.s3, d.s3, c.s6, d.s6, c.s7, d.s7);
    *c2 = (float8)(ab.s01, cd.s01, ab.s45, cd.s45);
    *c3 = (float8)(ab.s23, cd.s23, ab.s67, cd.s67);
}

/* which of four neighbours on each side along an axis show what a row with guide a does, as bits 0..7, and mirror it too, 8..15
 * row: of the grid's guides; stride: of neighbours, in rows; low, high: the first and last that there are */
inline ushort alike_along(float16 a, float wide, int sharp_reach, __global const float *row, int stride, int low, int high)
{
    int8 k = (int8)(-4, -3, -2, -1, 1, 2, 3, 4), away = (int8)(4, 3, 2, 1, 1, 2, 3, 4);
    int at[8]; /* those that are not there stand for the middle, and do not count */
    #pragma unroll
    for (int j = 0; j < 8; j++) {
        int step = j < 4 ? j - 4 : j - 3;
        at[j] = ((step >= low) & (step <= high)) ? step * stride * GUIDE : 0;
    }
    float8 x, y, z, gap, nx, ny, nz, kind, mx, my, mz, alpha;
    columns_of(row, at, &x, &y, &z, &gap);
    columns_of(row + G_NORMAL, at, &nx, &ny, &nz, &kind);
    columns_of(row + G_MIRROR, at, &mx, &my, &mz, &alpha);
    int8 counts = (k >= low) & (k <= high) & is_alike(a, x, y, z, nx, ny, nz, kind, (int8)(0));
    int8 is_near = counts & (away <= sharp_reach) & mirrors_alike(a, wide, mx, my, mz, alpha);
    int8 bit = (int8)(1, 2, 4, 8, 16, 32, 64, 128), set = (counts & bit) | (is_near & (bit << 8));
    int4 four = set.lo | set.hi;
    return (ushort)(four.x | four.y | four.z | four.w);
}

/* what the filter looks at about each row, which is the same for all light
 * is_grid      whether the rows are those of the grid, else `pixel` (rows) says where each is
 * guide        of the rows; grid_guide of the grid
 * alike (rows, 4) result: neighbours along rows and along columns, of alike_along; whether the grid's row in the middle shows the
 *              same (1) and mirrors it (2); how far specular light reaches, -1 where nothing is seen
 */
__kernel void find_alike(
    const uint count, const int width, const int height, const int is_grid, __global const uint *pixel, __global const float *guide,
    __global const float *grid_guide, __global short *alike)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    float16 a = vload16(i, guide); /* position, gap, normal, class, mirror direction, alpha */
    if (a.s7 < 0.0f) {
        vstore4((short4)(0, 0, 0, -1), i, alike);
        return;
    }
    uint p = is_grid ? i : pixel[i];
    int x = p % width, y = p / width, sharp_reach = (int)guide[i * GUIDE + G_TILE] / 2;
    float wide = guide[i * GUIDE + G_WIDTH];
    __global const float *row = grid_guide + (size_t)p * GUIDE;
    float16 b = vload16(0, row);
    int is_middle = is_alike(a, b.s0, b.s1, b.s2, b.s4, b.s5, b.s6, b.s7, is_grid);
    int is_mirror = is_middle & (is_grid | mirrors_alike(a, wide, b.s8, b.s9, b.sa, b.sb));
    short across = alike_along(a, wide, sharp_reach, row, 1, -x, width - 1 - x);
    short down = alike_along(a, wide, sharp_reach, row, width, -y, height - 1 - y);
    vstore4((short4)(across, down, (is_middle ? 1 : 0) | (is_mirror ? 2 : 0), sharp_reach), i, alike);
}

/* light (rows, LIGHT) averaged along one axis of a window, of TILE at most, over the rows of the picture's grid
 * width     of the grid
 * is_column whether the axis is that of columns
 * is_grid   whether the rows are those of the grid, else `pixel` (rows) says where each is
 * alike, own (rows, .); light of the grid
 * to_own    whether rows of many frames get their own light back
 */
__kernel void filter_light(
    const uint count, __global const uint *rows, const int width, const int is_column, const int window, const int is_grid,
    const int to_own, __global const uint *pixel, __global const short *alike, __global const float *own,
    __global const float *light, __global float *filtered)
{
    size_t nth = get_global_id(0);
    if (nth >= count) return;
    size_t i = rows[nth];
    short4 about = vload4(i, alike);
    if (about.w < 0) {
        vstore16((float16)(0.0f), i, filtered);
        return;
    }
    float16 mine = vload16(i, own);
    float keep = within((mine.sf - FILTERED_FRAMES) * (1.0f / (SET - FILTERED_FRAMES)), 0.0f, 1.0f);
    if (keep >= 1.0f) {
        vstore16(mine, i, filtered);
        return;
    }
    int reach = window / 2, sharp_reach = about.w, stride = (is_column ? width : 1) * LIGHT;
    /* both ends of an even window count half */
    int8 away = (int8)(4, 3, 2, 1, 1, 2, 3, 4), bit = (int8)(1, 2, 4, 8, 16, 32, 64, 128), set = (int8)(is_column ? about.y : about.x);
    float8 m = away < reach ? (float8)(1.0f) : away == reach ? (float8)(window & 1 ? 1.0f : 0.5f) : (float8)(0.0f);
    m = (set & bit) != 0 ? m : (float8)(0.0f);
    float8 n = (set & (bit << 8)) != 0 ? m : (float8)(0.0f);
    n = ((n > 0.0f) & (away == sharp_reach)) ? (float8)(0.5f) : n;
    float middle = about.z & 1 ? 1.0f : 0.0f, sharp_middle = about.z & 2 ? 1.0f : 0.0f;
    light += (size_t)(is_grid ? i : pixel[i]) * LIGHT;
    float16 sum = (float16)(0.0f), sharp = (float16)(0.0f);
#define ADD(STEP, M, N)                                 \
    if (M > 0.0f) {                                     \
        float16 l = vload16(0, light + STEP * stride);  \
        sum += M * l;                                   \
        sharp += N * l;                                 \
    }
    ADD(-4, m.s0, n.s0) ADD(-3, m.s1, n.s1) ADD(-2, m.s2, n.s2) ADD(-1, m.s3, n.s3) ADD(0, middle, sharp_middle)
    ADD(1, m.s4, n.s4) ADD(2, m.s5, n.s5) ADD(3, m.s6, n.s6) ADD(4, m.s7, n.s7)
    float4 m4 = m.lo + m.hi, n4 = n.lo + n.hi;
    float matte = m4.x + m4.y + m4.z + m4.w + middle, specular = n4.x + n4.y + n4.z + n4.w + sharp_middle;
    sum = matte > 0.0f ? sum * (1.0f / matte) : mine;
    sharp = specular > 0.0f ? sharp * (1.0f / specular) : mine;
    float16 mean = (float16)(sum.s0123, sum.s45, sharp.s67, sharp.s89ab, sharp.scde, mine.sf);
    if (to_own) mean += keep * (mine - mean);
    vstore16(mean, i, filtered);
}

inline float3 radiance_of(__global const float *s, __global const float *l)
{
    return of_columns(s, row3(l, 0), row3(l, 3), row3(l, 6), row3(l, 9), row3(l, 12)) + row3(s, EMISSION);
}

/* what was shown before the light changed, without the diffuse light of the elements; [15] says whether anything was
 * former (rows, LIGHT): of the change before that; kept (rows, LIGHT) result */
__kernel void keep_former(
    const uint count, __global const uint *rows, __global const float *surfaces, __global const float *light,
    const int has_former, __global const float *former, __global const float *soft, __global const float *fresnel,
    __global float *kept)
{
    size_t at = get_global_id(0);
    if (at >= count) return;
    size_t i = rows[at];
    float y = share_of_y(surfaces + i * SURFACE, fresnel);
    float3 known = load3(soft, i);
    float16 l = vload16(0, light + i * LIGHT);
    l.s012 -= (1.0f - y) * known;
    l.s345 -= y * known;
    if (has_former && former[i * LIGHT + 15] > 0.0f) {
        float frames = l.sf;
        l += known_share(frames) * (vload16(0, former + i * LIGHT) - l);
        l.sf = larger(frames, 1.0f);
    }
    vstore16(l, 0, kept + i * LIGHT);
}

/* what some rows send towards the eye: radiance (rows, 3) result
 * former (rows, LIGHT): of keep_former, which fades out as frames are gathered; its diffuse light is that of the elements now */
__kernel void shade(
    const uint count, __global const uint *rows, __global const float *surfaces, __global const float *light,
    const int has_former, __global const float *former, __global const float *soft, __global const float *fresnel,
    __global float *radiance)
{
    size_t at = get_global_id(0);
    if (at >= count) return;
    size_t i = rows[at];
    __global const float *s = surfaces + i * SURFACE;
    float3 out = radiance_of(s, light + i * LIGHT);
    if (has_former && former[i * LIGHT + 15] > 0.0f) {
        float w = known_share(light[i * LIGHT + 15]), y = share_of_y(s, fresnel);
        float3 d = row3(s, DIFFUSE), known = load3(soft, i);
        float3 before = radiance_of(s, former + i * LIGHT);
        before += d * ((1.0f - row3(s, F_ZERO)) * (1.0f - y) + (1.0f - row3(s, F_NINETY)) * y) * known;
        out += w * (before - out);
    }
    store3(out, radiance, i);
}

/* backdrop (pixels, 3): lights and domes in view; share: of its pixel that each row is; first_more (pixels + 1) of the rows behind
 * the grid's own, `more_*` */
__kernel void combine(
    const uint count, __global const float *radiance, __global const float *share, __global const float *backdrop,
    const int has_more, __global const uint *first_more, __global const float *more_radiance, __global const float *more_share,
    __global float *picture)
{
    size_t p = get_global_id(0);
    if (p >= count) return;
    float3 sum = load3(backdrop, p) + share[p] * load3(radiance, p);
    uint last = has_more ? first_more[p + 1] : 0;
    for (uint k = has_more ? first_more[p] : 0; k < last; k++) sum += more_share[k] * load3(more_radiance, k);
    store3(sum, picture, p);
}

/* pixels next to which something else is seen
 * edge (pixels) result */
__kernel void find_edges(const uint count, const int width, const int height, __global const float *guide, __global uchar *edge)
{
    size_t p = get_global_id(0);
    if (p >= count) return;
    int x = p % width, y = p / width, found = 0;
    __global const float *a = guide + p * GUIDE;
    for (int k = 0; k < 4; k++) {
        int u = x + (k == 0) - (k == 1), v = y + (k == 2) - (k == 3);
        if (u < 0 || v < 0 || u >= width || v >= height) continue;
        __global const float *b = guide + ((size_t)v * width + u) * GUIDE;
        if (b[G_CLASS] < 0.0f && a[G_CLASS] < 0.0f) continue;
        found |= a[G_CLASS] != b[G_CLASS] || inner(row3(a, G_NORMAL), row3(b, G_NORMAL)) < EDGE_COSINE
                 || fabs(inner(row3(b, 0) - row3(a, 0), row3(a, G_NORMAL))) > 3.0f * a[G_GAP];
    }
    edge[p] = found;
}

/* columns and moments of some rows to `kept` (count, KEPT), or back */
__kernel void move_rows(
    const uint count, const int is_back, __global const uint *rows, __global float *columns, __global float *moments,
    __global float *kept)
{
    size_t at = get_global_id(0);
    if (at >= count) return;
    __global float *c = columns + rows[at] * (size_t)COLUMNS, *m = moments + rows[at] * (size_t)2, *k = kept + at * KEPT;
    for (int j = 0; j < COLUMNS; j++)
        if (is_back) c[j] = k[j]; else k[j] = c[j];
    for (int j = 0; j < 2; j++)
        if (is_back) m[j] = k[COLUMNS + j]; else k[COLUMNS + j] = m[j];
}

/* starts some rows anew */
__kernel void forget_rows(const uint count, __global const uint *rows, __global float *columns, __global float *moments)
{
    size_t at = get_global_id(0);
    if (at >= count) return;
    size_t i = rows[at];
    for (int k = 0; k < COLUMNS; k++) columns[i * COLUMNS + k] = 0.0f;
    moments[2 * i] = moments[2 * i + 1] = 0.0f;
}
