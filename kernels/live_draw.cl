/* live_draw.cl: the directions that the first surfaces of a live picture look in, and what light from there is weighted by.
 *
 *     draw_flat_light  of each row: a direction towards a light that is flat and shines evenly
 *     draw_dome        the same towards a dome
 *     draw_any_source  the same towards any source, or one of many
 *     draw_specular    a direction of a specular lobe
 *     draw_diffuse     a direction of a diffuse lobe, or of the guide
 *
 * Kernels of their own, which but for the third know no branches and no vectors, so that a CPU puts work-items into its lanes.
 * A work-item beyond the end does what the last one does, and writes nothing: under a condition PoCL's compiler takes all
 * work for half of what it is, and lanes for too dear.
 */
#include "live_lobes.cl"

/* rows and what they draw
 * numbers   (streams + 2, set_size, 4) of [0, 1)
 * place     (rows) of each in its tile, which shares a set of numbers
 * sharp_place  (rows) the same for the specular lobe, whose tile may be smaller
 * identity  (rows) numbers that tell rows of a picture apart
 * set_size, stride, shift_by, flip: a place takes number (place * stride + shift_by) ^ flip of a set of set_size
 * near_mask  of places in the smaller tile of what has a place itself, whose shadows are to stay sharp
 * is_shared whether all tiles take the same numbers: then the mean over any tile is that of a set, and what it is wrong by is alike
 *           everywhere; else each row shifts them by numbers of its own, and what is wrong is noise
 * guides    (N, blocks) cumulative chances; guided: share of the diffuse rays that is drawn by them */
#define ROW_PARAMETERS                                                                                                            \
    const uint count, __global const uint *rows, const uint set_size, const uint stride, const uint shift_by, const uint flip,    \
        const uint near_mask, const uint round, const int is_shared, const int sends_diffuse, __global const float *surfaces,     \
        __global const uchar *place, __global const uchar *sharp_place, __global const uint *identity,                            \
        __global const float *numbers, __global const float *guides, __global const float *frames, const float guided
#define ROW                                                                                                                       \
    count, rows, set_size, stride, shift_by, flip, near_mask, round, is_shared, sends_diffuse, surfaces, place, sharp_place,      \
        identity, numbers, guides, frames, guided

typedef struct {
    Lobe lobe;
    Triple start, geometric, shift;
    int is_there, is_diffuse, is_weak, has_element, element;
    float by_guide, chance_of_coat, sent; /* sent: share of the frames in which it sends a specular ray */
    uint at, near_at, sharp_at, drawn_at;
} Row;

inline Row row_of(ROW_PARAMETERS, uint i)
{
    Row o;
    uint row = rows[i < count ? i : count - 1];
    __global const float *surface = surfaces + (size_t)row * SURFACE;
    o.lobe = lobe_of(surface);
    o.start = start_of(surface);
    o.geometric = triple(surface, GEOMETRIC);
    o.is_there = surface[MATERIAL] >= 0.0f;
    /* diffuse light needs the whole tile */
    int is_matte = largest(triple(surface, DIFFUSE)) > 0.0f;
    uint sharp = sharp_place[row], whole = place[row], wide = is_matte ? whole : sharp;
    o.at = (wide * stride + shift_by) ^ flip;
    o.near_at = ((wide & near_mask) * stride + shift_by) ^ flip;
    uint own = identity[row] * 2654435761u + 12345u;
    random(&own);
    o.shift.x = random(&own);
    o.shift.y = random(&own);
    o.shift.z = random(&own);
    o.shift = times(is_shared ? 0.0f : 1.0f, o.shift);
    o.drawn_at = ((round + (is_shared ? 0u : own)) * set_size + o.at) % DRAWN;
    o.chance_of_coat = o.lobe.coat > 0.0f ? 0.4f * o.lobe.coat : 0.0f;
    o.is_diffuse = (sends_diffuse != 0) & is_matte;
    int element = (int)surface[ELEMENT];
    o.by_guide = element < 0 ? 0.0f : guided;
    o.has_element = element >= 0;
    o.element = larger(element, 0);
    /* wide and weak reflections, over a diffuse colour, get fewer rays */
    o.is_weak = (o.lobe.alpha > WEAK_ALPHA) & (o.lobe.e.z > WEAK_COSINE) & (bright(triple(surface, F_ZERO)) < WEAK_F_ZERO)
                & is_matte & !(o.lobe.coat > 0.0f);
    /* where frames complete each other every WEAK_EVERY-th sends one, of a smaller set, which is whole */
    uint weak_stride = (stride + WEAK_EVERY - 1) / WEAK_EVERY;
    o.sent = !o.is_weak ? 1.0f : stride > 1 ? (float)weak_stride / (float)stride : WEAK_SHARE;
    uint of_weak = (sharp * weak_stride + shift_by / WEAK_EVERY) ^ flip;
    o.sharp_at = (o.is_weak & (stride > 1)) ? of_weak : (sharp * stride + shift_by) ^ flip;
    return o;
}

/* one of the numbers of a set, each shifted */
inline float shifted(__global const float *number, float shift)
{
    float x = *number + shift;
    return x - (float)(int)x; /* a comparison would put pairs of numbers into vectors */
}

/* ── towards sources ── */

/* shadow_*  (streams, count) rays towards sources; length 0: none
 * shone     (8, streams, count): weights of the columns, radiance */
#define SHONE_PARAMETERS                                                                                                          \
    __global float *shadow_origin, __global float *shadow_direction, __global float *shadow_length, __global float *shone
#define SHONE shadow_origin, shadow_direction, shadow_length, shone

/* what would arrive at a row from a source, in the place of its stream; sampled: density with which it was drawn, 0: nothing arrives */
inline void put_shone(
    Row o, uint i, const uint count, int streams, int stream, __global const float *source, __global const float *guides,
    __global const float *frames, Triple d, float distance, Triple radiance, float sampled, SHONE_PARAMETERS)
{
    Triple l = local_in(o.lobe, d);
    int shines = o.is_there & (sampled > 0.0f) & (largest(radiance) > 0.0f) & (l.z > 0.0f) & (inner(o.geometric, d) > 0.0f);
    Weights w = weights_of(o.lobe, l, unit(plus(o.lobe.e, l)));
    float met = source[SRC_ALONE] > 0.0f ? 0.0f : 1.0f; /* rays of the lobes do not meet some */
    float by_guide = guided_density(guides, frames, o.is_diffuse ? o.element : 0, d), by_cosine = l.z / PI_F;
    float diffuse = o.is_diffuse ? by_cosine + o.by_guide * (by_guide - by_cosine) : 0.0f;
    float specular = o.sent * (w.lobe_pdf + o.chance_of_coat * (w.coat_pdf - w.lobe_pdf));
    float of_diffuse = source[SRC_DIFFUSE] / (sampled + met * diffuse);
    float of_specular = source[SRC_SPECULAR] / (sampled + met * specular);
    float length = shines ? lesser(distance * (1.0f - 1e-4f), 1e37f) : 0.0f;
    if (i >= count) return;
    size_t to = (size_t)stream * count + i;
    size_t plane = (size_t)streams * count;
    shone[to] = w.x * of_diffuse;
    shone[plane + to] = w.y * of_diffuse;
    shone[2 * plane + to] = w.a * of_specular;
    shone[3 * plane + to] = w.b * of_specular;
    shone[4 * plane + to] = w.coat * of_specular;
    shone[5 * plane + to] = radiance.x;
    shone[6 * plane + to] = radiance.y;
    shone[7 * plane + to] = radiance.z;
    put3(o.start, shadow_origin, 3 * to);
    put3(d, shadow_direction, 3 * to);
    shadow_length[to] = length;
}

/* sources (., SOURCE), of which the stream's is drawn */
__kernel void draw_flat_light(ROW_PARAMETERS, const int streams, const int stream, __global const float *sources, SHONE_PARAMETERS)
{
    uint i = get_global_id(0);
    Row o = row_of(ROW, i);
    __global const float *source = sources + stream * SOURCE, *u = numbers + 4 * (stream * set_size + o.near_at);
    Triple p = triple(surfaces + (size_t)rows[i < count ? i : count - 1] * SURFACE, POSITION), d;
    float2 at;
    float distance, density;
    draw_flat_at(source, p, shifted(u, o.shift.x), shifted(u + 1, o.shift.y), &at, &d, &distance, &density);
    put_shone(o, i, count, streams, stream, source, guides, frames, d, distance, triple(source, SRC_RADIANCE), density, SHONE);
}

/* drawn (domes, DRAWN, 8) directions of domes */
__kernel void draw_dome(
    ROW_PARAMETERS, const int streams, const int stream, __global const float *sources, __global const float *drawn,
    SHONE_PARAMETERS)
{
    uint i = get_global_id(0);
    Row o = row_of(ROW, i);
    __global const float *source = sources + stream * SOURCE;
    __global const float *one = drawn + ((size_t)source[SRC_DRAWN] * DRAWN + o.drawn_at) * 8;
    put_shone(o, i, count, streams, stream, source, guides, frames, triple(one, 0), INFINITY, triple(one, 4), one[3], SHONE);
}

/* where there are more sources than streams one is chosen for each row */
__kernel void draw_any_source(ROW_PARAMETERS, const int stream, SCENE_PARAMETERS, SHONE_PARAMETERS)
{
    uint i = get_global_id(0);
    if (i >= count) return;
    Row o = row_of(ROW, i);
    float3 p = row3(surfaces + (size_t)rows[i] * SURFACE, POSITION);
    int each = streams == source_count, is_near = !each || (int)sources[stream * SOURCE + SRC_KIND] != DOME;
    __global const float *u = numbers + 4 * (stream * set_size + (is_near ? o.near_at : o.at));
    float chance = 1.0f;
    int chosen = each ? stream : choose_source(sources, source_count, p, shifted(u + 2, o.shift.z), &chance);
    shadow_length[(size_t)stream * count + i] = 0.0f;
    if (chosen < 0 || sources[chosen * SOURCE + SRC_SAMPLED] <= 0.0f) return;
    Arrival a = draw_source(SCENE, chosen, p, (float2)(shifted(u, o.shift.x), shifted(u + 1, o.shift.y)), o.drawn_at);
    float sampled = a.density * chance * (each ? 1.0f : (float)streams);
    put_shone(o, i, count, streams, stream, sources + chosen * SOURCE, guides, frames, triple(a.direction), a.distance,
              triple(a.radiance), sampled, SHONE);
}

/* ── of lobes ── */

/* ray_*     (2, count) rays of the lobes, specular ones first; length 0: none
 * drawn_ray (DRAWN_RAY, 2, count): densities, weights over density */
#define RAY_PARAMETERS __global float *ray_origin, __global float *ray_direction, __global float *ray_length, __global float *drawn_ray
#define RAYS ray_origin, ray_direction, ray_length, drawn_ray

/* a ray of a lobe (0 specular, 1 diffuse); w: its weights; matte: as RAY_MATTE */
inline void put_ray(
    Row o, uint i, const uint count, int kind, int is_sent, Triple d, Weights w, float pdf, float lobe_pdf, float matte,
    RAY_PARAMETERS)
{
    int is_folded = fold(o.geometric, &d);
    float scale = 1.0f / pdf;
    if (i >= count) return;
    size_t to = (size_t)kind * count + i;
    size_t plane = (size_t)2 * count;
    drawn_ray[RAY_PDF * plane + to] = pdf;
    drawn_ray[RAY_LOBE_PDF * plane + to] = lobe_pdf;
    __global float *weights = drawn_ray + RAY_WEIGHTS * plane + to;
    weights[0] = kind == 1 ? w.x * scale : 0.0f;
    weights[plane] = kind == 1 ? w.y * scale : 0.0f;
    weights[2 * plane] = kind == 0 ? w.a * scale : 0.0f;
    weights[3 * plane] = kind == 0 ? w.b * scale : 0.0f;
    weights[4 * plane] = kind == 0 ? w.coat * scale : 0.0f;
    drawn_ray[RAY_FOLDED * plane + to] = is_folded ? 1.0f : 0.0f;
    drawn_ray[RAY_ELEMENT * plane + to] = o.has_element ? (float)o.element : -1.0f;
    /* what a ray brings to a matte surface, drawn from both lobes: sharp reflections are not judged */
    drawn_ray[RAY_MATTE * plane + to] = lobe_pdf >= SHARP_PDF ? 0.0f : matte;
    put3(o.start, ray_origin, 3 * to);
    put3(d, ray_direction, 3 * to);
    ray_length[to] = (is_sent & o.is_there & (pdf > 0.0f)) ? 1e37f : 0.0f;
}

__kernel void draw_specular(ROW_PARAMETERS, const int streams, RAY_PARAMETERS)
{
    uint i = get_global_id(0);
    Row o = row_of(ROW, i);
    __global const float *u = numbers + 4 * (streams * set_size + o.sharp_at);
    int is_coat = shifted(u + 2, o.shift.z) < o.chance_of_coat;
    int is_turn = !o.is_weak | (shift_by % WEAK_EVERY == 0);
    int is_due = ((stride > 1) & is_turn) | ((stride <= 1) & (u[3] < o.sent));
    Triple l, h;
    mirrored_by(is_coat ? o.lobe.coat_alpha : o.lobe.alpha, o.lobe.e, shifted(u, o.shift.x), shifted(u + 1, o.shift.y), &l, &h);
    Weights w = weights_of(o.lobe, l, h);
    float lobe_pdf = w.lobe_pdf + o.chance_of_coat * (w.coat_pdf - w.lobe_pdf);
    float matte = 2.0f * l.z / (l.z + PI_F * lobe_pdf);
    put_ray(o, i, count, 0, is_due & (l.z > 0.0f), world_from(o.lobe, l), w, o.sent * lobe_pdf, lobe_pdf, matte, RAYS);
}

__kernel void draw_diffuse(ROW_PARAMETERS, const int streams, RAY_PARAMETERS)
{
    uint i = get_global_id(0);
    Row o = row_of(ROW, i);
    __global const float *u = numbers + 4 * ((streams + 1) * set_size + o.at);
    /* the first number chooses, and what is left of it draws: half of a net is a net */
    float x = shifted(u, o.shift.x), y = shifted(u + 1, o.shift.y);
    int is_guided = x < o.by_guide;
    Triple towards = guided_towards(guides, frames, o.element, is_guided ? x / o.by_guide : 0.0f, y);
    Triple l = cosine_direction(is_guided ? 0.0f : (x - o.by_guide) / (1.0f - o.by_guide), y), d = world_from(o.lobe, l);
    d.x = is_guided ? towards.x : d.x;
    d.y = is_guided ? towards.y : d.y;
    d.z = is_guided ? towards.z : d.z;
    Triple turned = local_in(o.lobe, towards);
    l.x = is_guided ? turned.x : l.x;
    l.y = is_guided ? turned.y : l.y;
    l.z = is_guided ? turned.z : l.z;
    Weights w = weights_of(o.lobe, l, unit(plus(o.lobe.e, l)));
    float lobe_pdf = l.z / PI_F;
    float pdf = lobe_pdf + o.by_guide * (guided_density(guides, frames, o.element, d) - lobe_pdf);
    put_ray(o, i, count, 1, o.is_diffuse & (l.z > 0.0f), d, w, pdf, lobe_pdf, lobe_pdf / pdf, RAYS);
}
