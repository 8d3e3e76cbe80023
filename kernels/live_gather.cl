/* live_gather.cl: the light that arrives at the surfaces of a live picture, one frame at a time.
 *
 *     draw_first      of each row: a direction towards each source, one of its specular lobes, one of its diffuse lobe
 *     arrive_first    what the rays of the lobes met; which of them are followed (live_paths.cl)
 *     add_frame       all of it, added to the columns of the rows
 *     add_paths       what rays that were followed brought, later
 *
 * Light without the surface's colours, as of render/gather.py: L = d [(1 - F0) X + (1 - F90) Y] + F0 A + F90 B + coat.  X and Y
 * are estimated by sources and the diffuse ray, A, B and coat by sources and the specular ray, each by the balance heuristic
 * (Veach and Guibas 1995).  Rays are traced on the host between these kernels.
 */
#include "live_lobes.cl"
#include "live_arrival.cl"

/* ── the first surface ── */

inline float4 shifted(float4 u, float4 shift)
{
    float4 x = u + shift;
    return (float4)(x.x >= 1.0f ? x.x - 1.0f : x.x, x.y >= 1.0f ? x.y - 1.0f : x.y, x.z >= 1.0f ? x.z - 1.0f : x.z, x.w);
}

/* rays and weights of rows (count)
 * numbers   (streams + 2, set_size) float4 of [0, 1)
 * place     (rows) of each in its tile, which shares a set of numbers
 * sharp_place  (rows) the same for the specular lobe, whose tile may be smaller
 * identity  (rows) numbers that tell rows of a picture apart
 * set_size, stride, shift_by, flip: a place takes number (place * stride + shift_by) ^ flip of a set of set_size
 * near_mask  of places in the smaller tile of what has a place itself, whose shadows are to stay sharp
 * is_shared whether all tiles take the same numbers: then the mean over any tile is that of a set, and what it is wrong by is alike
 *           everywhere; else each row shifts them by numbers of its own, and what is wrong is noise
 * guides    (N, blocks) cumulative chances; guided: share of the diffuse rays that is drawn by them
 * shadow_*  (streams, count) rays towards sources; length 0: none
 * shone     (streams, count, 8): weights of the columns, radiance
 * ray_*     (2, count) rays of the lobes, specular ones first
 * drawn_ray (2, count, DRAWN_RAY): densities, weights over density
 */
__kernel void draw_first(
    const uint count, __global const uint *rows, const uint set_size, const uint stride, const uint shift_by, const uint flip,
    const uint near_mask, const uint round, const int is_shared, const int sends_diffuse,
    __global const float *surfaces, __global const uchar *place, __global const uchar *sharp_place, __global const uint *identity, __global const float4 *numbers,
    SCENE_PARAMETERS, __global const float *guides, __global const float *frames, const float guided,
    __global float *shadow_origin, __global float *shadow_direction, __global float *shadow_length, __global float *shone,
    __global float *ray_origin, __global float *ray_direction, __global float *ray_length, __global float *drawn_ray)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    size_t row = rows[i];
    __global const float *surface = surfaces + row * SURFACE;
    if (surface[MATERIAL] < 0.0f) {
        for (int s = 0; s < streams; s++) shadow_length[s * count + i] = 0.0f;
        ray_length[i] = ray_length[count + i] = 0.0f;
        return;
    }
    Lobe lobe = lobe_of(surface);
    float3 p = row3(surface, POSITION), start = start_of(surface), geometric = row3(surface, GEOMETRIC);
    /* diffuse light needs the whole tile */
    uint sharp = sharp_place[row], wide = largest(row3(surface, DIFFUSE)) > 0.0f ? place[row] : sharp;
    uint sharp_at = (sharp * stride + shift_by) ^ flip, at = (wide * stride + shift_by) ^ flip;
    uint near_at = ((wide & near_mask) * stride + shift_by) ^ flip;
    uint own = identity[row] * 2654435761u + 12345u, drawn_at = (round * set_size + at) % DRAWN;
    float4 shift = (float4)(0.0f);
    if (!is_shared) {
        random(&own);
        shift = (float4)(random(&own), random(&own), random(&own), 0.0f);
        drawn_at = ((round + own) * set_size + at) % DRAWN;
    }
    float chance_of_coat = lobe.coat > 0.0f ? 0.4f * lobe.coat : 0.0f;
    int is_diffuse = sends_diffuse && largest(row3(surface, DIFFUSE)) > 0.0f;
    int element = (int)surface[ELEMENT], each = streams == source_count;
    float by_guide = element < 0 ? 0.0f : guided;
    /* wide and weak reflections, over a diffuse colour, get fewer rays */
    int is_weak = lobe.alpha > WEAK_ALPHA && lobe.e.z > WEAK_COSINE && bright(row3(surface, F_ZERO)) < WEAK_F_ZERO
                  && largest(row3(surface, DIFFUSE)) > 0.0f && !(lobe.coat > 0.0f);
    /* where frames complete each other every WEAK_EVERY-th sends one, of a smaller set, which is whole */
    uint weak_stride = (stride + WEAK_EVERY - 1) / WEAK_EVERY;
    float sent = !is_weak ? 1.0f : stride > 1 ? (float)weak_stride / (float)stride : WEAK_SHARE;
    if (is_weak && stride > 1) sharp_at = (sharp * weak_stride + shift_by / WEAK_EVERY) ^ flip;
    float w[WEIGHTS], lobe_pdf, coat_pdf;

    for (int s = 0; s < streams; s++) {
        size_t to = s * count + i;
        int is_near = !each || (int)sources[s * SOURCE + SRC_KIND] != DOME;
        float4 u = shifted(numbers[s * set_size + (is_near ? near_at : at)], shift);
        float chance = 1.0f;
        int chosen = each ? s : choose_source(sources, source_count, p, u.z, &chance);
        shadow_length[to] = 0.0f;
        if (chosen < 0 || sources[chosen * SOURCE + SRC_SAMPLED] <= 0.0f) continue;
        __global const float *source = sources + chosen * SOURCE;
        Arrival a = draw_source(SCENE, chosen, p, u.xy, drawn_at);
        if (!(a.density > 0.0f && largest(a.radiance) > 0.0f)) continue;
        float3 l = local_in(lobe, a.direction);
        if (!(l.z > 0.0f && inner(geometric, a.direction) > 0.0f)) continue;
        weights_of(lobe, l, unit(lobe.e + l), w, &lobe_pdf, &coat_pdf);
        float sampled = a.density * chance * (each ? 1.0f : (float)streams);
        float specular = sent * ((1.0f - chance_of_coat) * lobe_pdf + chance_of_coat * coat_pdf);
        int alone = source[SRC_ALONE] > 0.0f; /* rays of the lobes do not meet it */
        float diffuse = 0.0f;
        if (is_diffuse && !alone) {
            diffuse = (1.0f - by_guide) * l.z / PI_F;
            if (by_guide > 0.0f) diffuse += by_guide * guided_density(guides, frames, element, a.direction);
        }
        float of_diffuse = 1.0f / (sampled + diffuse);
        float of_specular = 1.0f / (alone ? sampled : sampled + specular);
        __global float *out = shone + to * 8;
        #pragma unroll
        for (int k = 0; k < WEIGHTS; k++)
            out[k] = w[k] * (k < DIFFUSE_COLUMNS ? of_diffuse * source[SRC_DIFFUSE] : of_specular * source[SRC_SPECULAR]);
        put3(a.radiance, out, 5);
        store3(start, shadow_origin, to);
        store3(a.direction, shadow_direction, to);
        shadow_length[to] = lesser(a.distance * (1.0f - 1e-4f), 1e37f);
    }

    for (int kind = 0; kind < 2; kind++) { /* specular, diffuse */
        size_t to = kind * count + i;
        __global float *out = drawn_ray + to * DRAWN_RAY;
        ray_length[to] = 0.0f;
        if (kind == 1 && !is_diffuse) continue;
        float4 u = shifted(numbers[(streams + kind) * set_size + (kind == 0 ? sharp_at : at)], shift);
        if (kind == 0 && (stride > 1 ? is_weak && shift_by % WEAK_EVERY : !(u.w < sent))) continue;
        float3 l, h, d;
        if (kind == 0) {
            mirrored_by(u.z < chance_of_coat ? lobe.coat_alpha : lobe.alpha, lobe.e, u.xy, &l, &h);
            d = world_from(lobe, l);
        } else {
            /* the first number chooses, and what is left of it draws: half of a net is a net */
            if (u.x < by_guide) {
                d = guided_towards(guides, frames, element, (float2)(u.x / by_guide, u.y));
                l = local_in(lobe, d);
            } else {
                l = cosine_direction((float2)((u.x - by_guide) / (1.0f - by_guide), u.y));
                d = world_from(lobe, l);
            }
            h = unit(lobe.e + l);
        }
        if (!(l.z > 0.0f)) continue;
        weights_of(lobe, l, h, w, &lobe_pdf, &coat_pdf);
        lobe_pdf = kind == 0 ? (1.0f - chance_of_coat) * lobe_pdf + chance_of_coat * coat_pdf : l.z / PI_F;
        float pdf = kind == 0 ? sent * lobe_pdf : lobe_pdf;
        if (kind == 1 && by_guide > 0.0f)
            pdf = (1.0f - by_guide) * lobe_pdf + by_guide * guided_density(guides, frames, element, d);
        if (!(pdf > 0.0f)) continue;
        float scale = 1.0f / pdf;
        out[RAY_PDF] = pdf;
        out[RAY_LOBE_PDF] = lobe_pdf;
        #pragma unroll
        for (int k = 0; k < WEIGHTS; k++) out[RAY_WEIGHTS + k] = (k < DIFFUSE_COLUMNS) == (kind == 1) ? w[k] * scale : 0.0f;
        out[RAY_FOLDED] = fold(geometric, &d) ? 1.0f : 0.0f;
        out[RAY_ELEMENT] = surface[ELEMENT];
        /* what a ray brings to a matte surface, drawn from both lobes: sharp reflections are not judged */
        out[RAY_MATTE] = lobe_pdf >= SHARP_PDF ? 0.0f : kind == 1 ? l.z / (PI_F * pdf) : 2.0f * l.z / (l.z + PI_F * lobe_pdf);
        store3(start, ray_origin, to);
        store3(d, ray_direction, to);
        ray_length[to] = 1e37f;
    }
}

/* ── what arrives there ── */

/* rays of the first surfaces: arrived (n, 8) of lights, of surfaces, and whether each is followed
 * entry_of, who, weight: of live_entries.cl */
__kernel void arrive_first(
    const uint count, const int may_follow, SCENE_PARAMETERS, FIELD_PARAMETERS,
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
        __global const float *ray = drawn_ray + i * DRAWN_RAY;
        float pdf = ray[RAY_PDF], lobe_pdf = ray[RAY_LOBE_PDF];
        int t = triangle[i];
        lit = lit_along(SCENE, p, d, t, u_of[i], v_of[i], distance[i], pdf, ray[RAY_FOLDED] > 0.0f, 1);
        if (t >= 0) {
            int follows = entry_of[i] == IS_FOLLOWED;
            if (has_field && entry_of[i] < IS_FOLLOWED) {
                follows = may_follow;
                bounced = known_by(SCENE, FIELD, d, t, u_of[i], v_of[i], lobe_pdf, vload4(i, who), vload4(i, weight), &follows);
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
    for (int s = 0; s < streams; s++) {
        size_t at = s * count + i;
        if (!(shadow_length[at] > 0.0f) || blocked[at]) continue;
        float3 radiance = row3(shone + at * 8, 5);
        #pragma unroll
        for (int k = 0; k < WEIGHTS; k++) direct[k] += shone[at * 8 + k] * radiance;
    }
    for (int kind = 0; kind < 2; kind++) {
        size_t at = kind * count + i;
        if (!(ray_length[at] > 0.0f)) continue;
        __global const float *ray = drawn_ray + at * DRAWN_RAY;
        float3 lit = row3(arrived + at * 8, 0), bounced = held_back(ray, row3(arrived + at * 8, 3), arriving);
        if (kind == 1) {
            for (int k = 0; k < DIFFUSE_COLUMNS; k++) {
                direct[k] += ray[RAY_WEIGHTS + k] * lit;
                soft[k] += ray[RAY_WEIGHTS + k] * bounced;
            }
        } else {
            #pragma unroll
            for (int k = DIFFUSE_COLUMNS; k < WEIGHTS; k++) direct[k] += ray[RAY_WEIGHTS + k] * (lit + bounced);
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
    float3 brought = held_back(ray, row3(path, Q_LIGHT), arriving), of[WEIGHTS];
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
