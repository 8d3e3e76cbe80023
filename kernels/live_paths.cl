/* live_paths.cl: rays of a live picture that the light field has no good answer for, followed from surface to surface.
 *
 *     queue_paths     rays of first surfaces that are to be followed, behind those that wait
 *     gather_paths    those that go on, side by side
 *     scatter         at the surfaces that they met: one sample of one source, one ray onwards
 *     arrive_on_path  what that brought
 *
 * Rays of many batches wait until they are followed together: few steps of many rays keep all processors busy.
 */
#include "live_lobes.cl"
#include "live_arrival.cl"

/* the first surface's rays, of row_count rows, once or twice, that are followed: who (count), to the places from `first` on
 * seed      of what they draw
 * rows, identity, drawn_ray: as of live_draw.cl
 * queued (n, QUEUED): row, light that the path brings, what was drawn */
__kernel void queue_paths(
    const uint count, __global const int *who, const uint first, const uint seed, const uint row_count,
    __global const uint *rows, __global const uint *identity, __global const float *drawn_ray, __global const float *direction,
    __global const int *triangle, __global const float *u_of, __global const float *v_of,
    __global float *direction_to, __global int *triangle_to, __global float *u_to, __global float *v_to,
    __global float *state, __global float *queued)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    size_t from = who[i], to = first + i;
    uint is_second = from >= row_count, row = rows[from - (is_second ? row_count : 0u)];
    store3(load3(direction, from), direction_to, to);
    triangle_to[to] = triangle[from];
    u_to[to] = u_of[from];
    v_to[to] = v_of[from];
    size_t rays = (size_t)2 * row_count;
    __global const float *ray = drawn_ray + from;
    __global float *s = state + to * PATH, *out = queued + to * QUEUED;
    s[0] = s[1] = s[2] = 1.0f;
    s[3] = ray[RAY_LOBE_PDF * rays];
    s[4] = as_float((uint)to);
    s[10] = as_float(2u * identity[row] + is_second);
    s[11] = as_float(seed);
    out[Q_ROW] = as_float(row);
    #pragma unroll
    for (int k = 0; k < DRAWN_RAY; k++) out[Q_RAY + k] = ray[k * rays];
}

/* what paths need at the surfaces that they met, side by side */
__kernel void gather_paths(
    const uint count, __global const int *who, __global const float *direction, __global const int *triangle,
    __global const float *u_of, __global const float *v_of, __global const float *state,
    __global float *direction_to, __global int *triangle_to, __global float *u_to, __global float *v_to, __global float *state_to,
    __global float *least_roughness)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    size_t from = who[i];
    store3(load3(direction, from), direction_to, i);
    triangle_to[i] = triangle[from];
    u_to[i] = u_of[from];
    v_to[i] = v_of[from];
    #pragma unroll
    for (int k = 0; k < PATH; k++) state_to[i * PATH + k] = state[from * PATH + k];
    least_roughness[i] = state[from * PATH + 3] < SHARP_PDF ? CAUSTIC_ROUGHNESS : 0.0f;
}

/* state (PATH): throughput, least density so far, number of the first ray; then of the ray onwards its density and whether it
 * was folded up, what the sampled source brings where it is seen, a number of the first ray's own, and the seed of its frame
 * depth: surfaces on the path, with this one */
__kernel void scatter(
    const uint count, const uint depth, __global const float *surfaces, SCENE_PARAMETERS, __global float *state,
    __global float *shadow_origin, __global float *shadow_direction, __global float *shadow_length,
    __global float *ray_origin, __global float *ray_direction, __global float *ray_length)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    __global const float *surface = surfaces + i * SURFACE;
    __global float *s = state + i * PATH;
    Lobe lobe = lobe_of(surface);
    float3 p = row3(surface, POSITION);
    Triple start = start_of(surface), geometric = triple(surface, GEOMETRIC);
    uint random_state = as_uint(s[10]) * 9781u + (as_uint(s[11]) * 8u + depth) * 7919u;
    random(&random_state);
    float cover = surface[COVER], opacity = fabs(cover);
    /* a ray is stopped here with the probability `opacity`; what is reflected is not scaled by that */
    float3 throughput = row3(s, 0) * ((cover < 0.0f ? opacity : 1.0f) / larger(opacity, 0.05f));
    float g = 1.0f - lobe.e.z, g2 = g * g, f = g2 * g2 * g;
    float3 f0 = row3(surface, F_ZERO);
    float specular = bright(f0 + (row3(surface, F_NINETY) - f0) * f), diffuse = bright(row3(surface, DIFFUSE));
    float coat_chance = 0.25f * lobe.coat;
    float share = diffuse > 1e-4f * specular ? within(specular / larger(specular + diffuse, 1e-6f), 0.2f, 0.85f) : 1.0f;
    float specular_chance = share * (1.0f - coat_chance);
    float diffuse_chance = 1.0f - specular_chance - coat_chance;

    shadow_length[i] = 0.0f;
    float chance;
    int chosen = choose_source(sources, source_count, p, random(&random_state), &chance);
    float2 u;
    u.x = random(&random_state);
    u.y = random(&random_state);
    float3 shone = (float3)(0.0f);
    if (chosen >= 0) {
        __global const float *source = sources + chosen * SOURCE;
        Arrival a = draw_source(SCENE, chosen, p, u, (uint)(u.x * DRAWN));
        Triple l = local_in(lobe, triple(a.direction));
        if (a.density > 0.0f && l.z > 0.0f && inner(geometric, triple(a.direction)) > 0.0f) {
            Weights w = weights_of(lobe, l, unit(plus(lobe.e, l)));
            float pdf = diffuse_chance * l.z / PI_F + specular_chance * w.lobe_pdf + coat_chance * w.coat_pdf;
            float sampled = a.density * chance;
            float of = 1.0f / (source[SRC_ALONE] > 0.0f ? sampled : sampled + pdf);
            shone = throughput * reflected(surface, w, of * source[SRC_DIFFUSE], of * source[SRC_SPECULAR]) * a.radiance;
            if (largest(shone) > 0.0f) {
                put3(start, shadow_origin, 3 * i);
                store3(a.direction, shadow_direction, i);
                shadow_length[i] = lesser(a.distance * (1.0f - 1e-4f), 1e37f);
            }
        }
    }
    put3(shone, s, 7);

    ray_length[i] = 0.0f;
    float x = random(&random_state);
    u.x = random(&random_state);
    u.y = random(&random_state);
    Triple l, h;
    if (x < specular_chance + coat_chance) {
        mirrored_by(x < specular_chance ? lobe.alpha : lobe.coat_alpha, lobe.e, u.x, u.y, &l, &h);
    } else {
        l = cosine_direction(u.x, u.y);
        h = unit(plus(lobe.e, l));
    }
    if (!(l.z > 0.0f)) return;
    Weights w = weights_of(lobe, l, h);
    float pdf = diffuse_chance * l.z / PI_F + specular_chance * w.lobe_pdf + coat_chance * w.coat_pdf;
    if (!(pdf > 0.0f)) return;
    throughput *= reflected(surface, w, 1.0f / pdf, 1.0f / pdf);
    float most = largest(throughput); /* paths that bring little end by chance */
    if (!(most > 0.0f)) return;
    if (most < LITTLE) {
        if (random(&random_state) * LITTLE >= most) return;
        throughput *= LITTLE / most;
    }
    Triple d = world_from(lobe, l);
    put3(throughput, s, 0);
    s[3] = lesser(s[3], pdf);
    s[5] = pdf;
    s[6] = fold(geometric, &d) ? 1.0f : 0.0f;
    put3(start, ray_origin, 3 * i);
    put3(d, ray_direction, 3 * i);
    ray_length[i] = 1e37f;
}

/* blocked (n): whether something is between a surface and the source that was drawn there
 * is_first: what is brought is begun; arrived (., width): rows of which the light of surfaces is the second three */
__kernel void arrive_on_path(
    const uint count, const int may_follow, const int is_first, const uint width, SCENE_PARAMETERS, FIELD_PARAMETERS,
    __global const float *ray_origin, __global const float *ray_direction, __global const float *ray_length,
    __global const int *triangle, __global const float *u_of, __global const float *v_of, __global const float *distance,
    __global const float *shadow_length, __global const uchar *blocked, __global const float *state, __global float *arrived,
    __global uchar *followed)
{
    size_t i = get_global_id(0);
    if (i >= count) return;
    __global const float *s = state + i * PATH;
    float3 sum = shadow_length[i] > 0.0f && !blocked[i] ? row3(s, 7) : (float3)(0.0f);
    followed[i] = 0;
    if (ray_length[i] > 0.0f) {
        float3 p = load3(ray_origin, i), d = load3(ray_direction, i);
        int t = triangle[i];
        float pdf = s[5];
        float3 light = lit_along(SCENE, p, d, t, u_of[i], v_of[i], distance[i], pdf, s[6] > 0.0f, 0);
        if (t >= 0) {
            int follows = may_follow;
            light += known_along(SCENE, FIELD, p, d, t, u_of[i], v_of[i], distance[i], pdf, &follows);
            followed[i] = follows;
        }
        sum += row3(s, 0) * light;
    }
    __global float *out = arrived + (size_t)as_uint(s[4]) * width;
    put3(is_first ? sum : row3(out, 3) + sum, out, 3);
}
