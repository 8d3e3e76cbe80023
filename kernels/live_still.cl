/* live_still.cl: the final picture's own share of the live picture's kernels: sums of samples that the filter takes apart by how
 * wide it may look, and the tiles in which sharp reflections share their numbers.
 *
 *     tile_rows     how large the tile of each sample is for specular light
 *     add_samples   one ray of each kind, added to the sums
 *     add_paths_to_sums  what rays that were followed brought, later
 *     sum_blocks    luminance of blocks of samples, which their noise is read from
 *     scale_sums    of samples that have got more rays than others
 *     add_radiance  sums and colours to radiance
 *
 * Sums (rows, LIGHT) are X, Y, A, B, coat: `near` of lights that have a place, where they were sampled; `far` of domes, and of lights
 * that rays of the lobes met; `bounced` of surfaces; `exact` (rows, 3) is the radiance that lights without extent make.
 */
#include "live_lobes.cl"

/* step: how much the mirror direction changes from a sample to the next on the side where it changes less, along the axis where it
 * changes more; where the normal hardly changes beside it the surface is flat, and small tiles within the lobe's width are whole
 * least: side of the smallest tile; guide: in and out; place (rows) in the whole tile, sharp_place in this one: result */
__kernel void tile_rows(
    const uint count, const int width, const int height, const int least, __global float *guide,
    __global const uchar *place, __global uchar *sharp_place)
{
    size_t p = get_global_id(0);
    if (p >= count) return;
    __global float *a = guide + p * GUIDE;
    sharp_place[p] = place[p];
    if (a[G_CLASS] < 0.0f) return;
    int x = p % width, y = p / width;
    float3 n = row3(a, G_NORMAL), m = row3(a, G_MIRROR);
    float step = 0.0f, turn = 0.0f;
    for (int axis = 0; axis < 2; axis++) {
        float least_step = INFINITY, least_turn = INFINITY;
        for (int side = -1; side < 2; side += 2) {
            int u = x + (axis == 0 ? side : 0), v = y + (axis == 1 ? side : 0);
            if (u < 0 || v < 0 || u >= width || v >= height) continue;
            __global const float *b = guide + ((size_t)v * width + u) * GUIDE;
            float3 n2 = row3(b, G_NORMAL);
            if (b[G_CLASS] != a[G_CLASS] || inner(n, n2) <= NORMAL_COSINE) continue;
            least_step = lesser(least_step, size_of(row3(b, G_MIRROR) - m));
            least_turn = lesser(least_turn, size_of(n2 - n));
        }
        step = larger(step, least_step);
        turn = larger(turn, least_turn);
    }
    int is_flat = turn < INFINITY && turn <= FLAT * step + 1e-6f;
    float wide = lesser((is_flat ? LOBE_WIDTH : CURVED_WIDTH) * a[G_ALPHA], WIDEST);
    int tile = TILE;
    if (is_flat) {
        float reach = 1.41421356f * wide / larger(step, 1e-9f);
        tile = least;
        for (int side = 2 * least; side <= TILE; side *= 2)
            if (reach >= side) tile = side;
    }
    a[G_TILE] = tile;
    a[G_WIDTH] = wide;
    sharp_place[p] = place[p] & (tile * tile - 1);
}

inline float3 of_sums(__global const float *surface, float16 l)
{
    return of_columns(surface, l.s012, l.s345, l.s678, l.s9ab, l.scde);
}

/* light of one radiance as columns */
inline float16 weighted(const float *w, float3 radiance)
{
    return (float16)(w[0] * radiance, w[1] * radiance, w[2] * radiance, w[3] * radiance, w[4] * radiance, 0.0f);
}

/* is_first: the sums are begun; sent (rows): luminance that this frame alone makes; arguments as of add_frame of live_gather.cl */
__kernel void add_samples(
    const uint count, __global const uint *rows, const int source_count, const int streams, __global const float *sources,
    const int is_first, __global const float *surfaces, __global const float *shadow_length, __global const uchar *blocked,
    __global const float *shone, __global const float *ray_length, __global const float *drawn_ray,
    __global const float *arrived, __global const float *arriving, __global float *near, __global float *far,
    __global float *bounced, __global float *exact, __global float *sent)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    size_t row = rows[i];
    __global const float *surface = surfaces + row * SURFACE;
    int each = streams == source_count;
    size_t plane = (size_t)streams * count, rays = (size_t)2 * count;
    float3 at_once = (float3)(0.0f);
    float16 sums[3];
    for (int k = 0; k < 3; k++) sums[k] = (float16)(0.0f);
    for (int s = 0; s < streams; s++) {
        size_t at = s * count + i;
        if (!(shadow_length[at] > 0.0f) || blocked[at]) continue;
        float3 radiance = (float3)(shone[5 * plane + at], shone[6 * plane + at], shone[7 * plane + at]);
        float w[WEIGHTS];
        #pragma unroll
        for (int k = 0; k < WEIGHTS; k++) w[k] = shone[k * plane + at];
        __global const float *source = sources + s * SOURCE;
        int kind = (int)source[SRC_KIND];
        if (each && (kind == POINT || (kind == DISTANT && !(source[SRC_SIZE] > 0.0f)))) {
            at_once += of_sums(surface, weighted(w, radiance));
            continue;
        }
        sums[each && kind == DOME ? 1 : 0] += weighted(w, radiance);
    }
    for (int kind = 0; kind < 2; kind++) {
        size_t at = kind * count + i;
        if (!(ray_length[at] > 0.0f)) continue;
        __global const float *ray = drawn_ray + at;
        float w[WEIGHTS];
        #pragma unroll
        for (int k = 0; k < WEIGHTS; k++) w[k] = ray[(RAY_WEIGHTS + k) * rays];
        float3 bounced_off = held_back(ray[RAY_ELEMENT * rays], ray[RAY_MATTE * rays], row3(arrived + at * 8, 3), arriving);
        sums[1] += weighted(w, row3(arrived + at * 8, 0));
        sums[2] += weighted(w, bounced_off);
    }
    float16 zero = (float16)(0.0f);
    sent[row] = bright(of_sums(surface, sums[0] + sums[1] + sums[2]));
    if (near == far) sums[1] += sums[0];
    if (bounced == far) sums[1] += sums[2];
    if (near != far) vstore16((is_first ? zero : vload16(row, near)) + sums[0], row, near);
    if (bounced != far) vstore16((is_first ? zero : vload16(row, bounced)) + sums[2], row, bounced);
    vstore16((is_first ? zero : vload16(row, far)) + sums[1], row, far);
    store3((is_first ? (float3)(0.0f) : load3(exact, row)) + at_once, exact, row);
}

/* adds what paths brought to the frame that they are of; no two of these have one row; arguments as of add_paths of live_gather.cl */
__kernel void add_paths_to_sums(
    const uint count, const uint first, __global const float *queued, __global const float *surfaces,
    __global const float *arriving, __global float *bounced, __global float *sent)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    __global const float *path = queued + (first + i) * QUEUED, *ray = path + Q_RAY;
    size_t row = as_uint(path[Q_ROW]);
    float w[WEIGHTS];
    #pragma unroll
    for (int k = 0; k < WEIGHTS; k++) w[k] = ray[RAY_WEIGHTS + k];
    float16 light = weighted(w, held_back(ray[RAY_ELEMENT], ray[RAY_MATTE], row3(path, Q_LIGHT), arriving));
    vstore16(vload16(row, bounced) + light, row, bounced);
    sent[row] += bright(of_sums(surfaces + row * SURFACE, light));
}

/* sums of values (height, width) over blocks of side x side, the last ones cut off, to those from place * count on */
__kernel void sum_blocks(
    const uint count, const int width, const int height, const int side, const uint place, __global const float *values,
    __global float *sums)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    int blocks = (width + side - 1) / side, y0 = (int)i / blocks * side, x0 = (int)i % blocks * side;
    int y1 = lesser(y0 + side, height), x1 = lesser(x0 + side, width);
    float sum = 0.0f;
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++) sum += values[(size_t)y * width + x];
    sums[(size_t)place * count + i] = sum;
}

/* radiance (rows, 3) in and out: scale times what colours make of light */
__kernel void add_radiance(
    const uint count, __global const uint *rows, __global const float *surfaces, __global const float *light, const float scale,
    __global float *radiance)
{
    size_t at = get_global_id(0);
    if (at >= count) return;
    size_t i = rows[at];
    float3 sum = of_sums(surfaces + i * SURFACE, vload16(i, light));
    store3(load3(radiance, i) + scale * sum, radiance, i);
}

/* sums of some rows, times a factor */
__kernel void scale_sums(
    const uint count, __global const uint *rows, const float factor, __global float *near, __global float *far,
    __global float *bounced, __global float *exact)
{
    size_t at = get_global_id(0);
    if (at >= count) return;
    size_t i = rows[at];
    vstore16(factor * vload16(i, far), i, far);
    if (near != far) vstore16(factor * vload16(i, near), i, near);
    if (bounced != far) vstore16(factor * vload16(i, bounced), i, bounced);
    store3(factor * load3(exact, i), exact, i);
}
