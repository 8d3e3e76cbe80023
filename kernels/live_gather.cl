/* live_gather.cl: the light that arrives at the surfaces of a live picture, one frame at a time.
 *
 *     arrive_first    what the rays of the lobes met; which of them are followed (live_paths.cl)
 *     add_frame       all of it, added to the columns of the rows
 *     add_paths       what rays that were followed brought, later
 *
 * Light without the surface's colours, as of render/gather.py: L = d [(1 - F0) X + (1 - F90) Y] + F0 A + F90 B + coat.  X and Y
 * are estimated by sources and the diffuse ray, A, B and coat by sources and the specular ray, each by the balance heuristic
 * (Veach and Guibas 1995).  Rays are traced on the host between these kernels.
 */
#include "live_arrival.cl"

/* ── what arrives there ── */

/* rays of the first surfaces: arrived (n, 8) of lights, of surfaces, and whether each is followed
 * drawn_ray (DRAWN_RAY, rays) of live_draw.cl; entry_of, who, weight: of live_entries.cl */
__kernel void arrive_first(
    const uint count, const uint rays, const int may_follow, SCENE_PARAMETERS, FIELD_PARAMETERS,
    __global const float *ray_origin, __global const float *ray_direction, __global const float *ray_length,
    __global const int *triangle, __global const float *u_of, __global const float *v_of, __global const float *distance,
    __global const float *drawn_ray, __global const uint *entry_of, __global const uint *who, __global const float *weight,
    __global float *arrived, __global uchar *followed)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    __global float *out = arrived + i * 8;
    followed[i] = 0;
    float3 lit = (float3)(0.0f), bounced = (float3)(0.0f);
    if (ray_length[i] > 0.0f) {
        float3 p = load3(ray_origin, i), d = load3(ray_direction, i);
        __global const float *ray = drawn_ray + i;
        float pdf = ray[RAY_PDF * (size_t)rays], lobe_pdf = ray[RAY_LOBE_PDF * (size_t)rays];
        int t = triangle[i];
        lit = lit_along(SCENE, p, d, t, u_of[i], v_of[i], distance[i], pdf, ray[RAY_FOLDED * (size_t)rays] > 0.0f, 1);
        if (t >= 0) {
            int follows = entry_of[i] == IS_FOLLOWED;
            if (has_field && entry_of[i] < IS_FOLLOWED) {
                follows = may_follow;
                uint4 e = (uint4)(who[i], who[rays + i], who[2 * rays + i], who[3 * rays + i]);
                float4 w = (float4)(weight[i], weight[rays + i], weight[2 * rays + i], weight[3 * rays + i]);
                bounced = known_by(SCENE, FIELD, d, t, u_of[i], v_of[i], lobe_pdf, e, w, &follows);
            }
            followed[i] = follows;
        }
    }
    put3(lit, out, 0);
    put3(bounced, out, 3);
}

/* ── the sum ── */

/* adds a frame to the columns (rows, COLUMNS) of X and Y of sources, of X and Y of surfaces, A, B and coat, and to `moments`
 * (rows, 2) the luminance that the rows send and its square; latest (rows): the luminance of this frame
 * arriving (N): mean light at the elements, RAY_MOST of which a ray of a wide lobe may bring */
__kernel void add_frame(
    const uint count, __global const uint *rows, const int streams, const int sends_diffuse,
    __global const float *surfaces, __global const float *shadow_length,
    __global const uchar *blocked, __global const float *shone, __global const float *ray_length, __global const float *drawn_ray,
    __global const float *arrived, __global const float *arriving, __global float *columns, __global float *moments,
    __global float *latest)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    size_t row = rows[i];
    __global const float *surface = surfaces + row * SURFACE;
    if (surface[MATERIAL] < 0.0f) return;
    float3 direct[WEIGHTS], soft[2];
    #pragma unroll
    for (int k = 0; k < WEIGHTS; k++) direct[k] = (float3)(0.0f);
    soft[0] = soft[1] = (float3)(0.0f);
    size_t plane = (size_t)streams * count, rays = (size_t)2 * count;
    for (int s = 0; s < streams; s++) {
        size_t at = s * count + i;
        if (!(shadow_length[at] > 0.0f) || blocked[at]) continue;
        float3 radiance = (float3)(shone[5 * plane + at], shone[6 * plane + at], shone[7 * plane + at]);
        #pragma unroll
        for (int k = 0; k < WEIGHTS; k++) direct[k] += shone[k * plane + at] * radiance;
    }
    for (int kind = 0; kind < (sends_diffuse ? 2 : 1); kind++) {
        size_t at = kind * count + i;
        if (!(ray_length[at] > 0.0f)) continue;
        __global const float *ray = drawn_ray + at;
        float3 lit = row3(arrived + at * 8, 0);
        float3 bounced = held_back(ray[RAY_ELEMENT * rays], ray[RAY_MATTE * rays], row3(arrived + at * 8, 3), arriving);
        if (kind == 1) {
            for (int k = 0; k < DIFFUSE_COLUMNS; k++) {
                direct[k] += ray[(RAY_WEIGHTS + k) * rays] * lit;
                soft[k] += ray[(RAY_WEIGHTS + k) * rays] * bounced;
            }
        } else {
            #pragma unroll
            for (int k = DIFFUSE_COLUMNS; k < WEIGHTS; k++) direct[k] += ray[(RAY_WEIGHTS + k) * rays] * (lit + bounced);
        }
    }
    __global float *out = columns + row * COLUMNS;
    out[FRAMES] += 1.0f;
    out[GATHERED] += sends_diffuse ? 1.0f : 0.0f;
    put3(row3(out, 0) + direct[0], out, 0);
    put3(row3(out, 3) + direct[1], out, 3);
    put3(row3(out, 6) + soft[0], out, 6);
    put3(row3(out, 9) + soft[1], out, 9);
    #pragma unroll
    for (int k = 2; k < WEIGHTS; k++) put3(row3(out, 6 + 3 * k) + direct[k], out, 6 + 3 * k);
    float l = bright(of_columns(surface, direct[0] + soft[0], direct[1] + soft[1], direct[2], direct[3], direct[4]));
    moments[2 * row] += l;
    moments[2 * row + 1] += l * l;
    latest[row] = l;
}

/* adds what paths brought to the frame that they are of; no two of these have one row
 * queued (n, QUEUED): of queue_paths of live_paths.cl, `first` of which is the first; others as above */
__kernel void add_paths(
    const uint count, const uint first, __global const float *queued, __global const float *surfaces,
    __global const float *arriving, __global float *columns, __global float *moments, __global float *latest)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    __global const float *path = queued + (first + i) * QUEUED, *ray = path + Q_RAY;
    size_t row = as_uint(path[Q_ROW]);
    float3 brought = held_back(ray[RAY_ELEMENT], ray[RAY_MATTE], row3(path, Q_LIGHT), arriving), of[WEIGHTS];
    __global float *out = columns + row * COLUMNS;
    #pragma unroll
    for (int k = 0; k < WEIGHTS; k++) {
        of[k] = ray[RAY_WEIGHTS + k] * brought;
        put3(row3(out, 6 + 3 * k) + of[k], out, 6 + 3 * k);
    }
    float l = bright(of_columns(surfaces + row * SURFACE, of[0], of[1], of[2], of[3], of[4])), before = latest[row];
    moments[2 * row] += l;
    moments[2 * row + 1] += l * (l + 2.0f * before);
    latest[row] = before + l;
}
