/* live_lobes.cl: the directions that a surface of a live picture sends rays in, and how likely each is: its lobes, and the guide
 * that says where light comes from. */
#include "live_sources.cl"
#include "bin_blocks.cl"

/* ── lobes ── */

typedef struct {
    Triple t, b, n, e; /* frame of the shading normal, and the eye in it */
    float alpha, coat_alpha, coat, coat_f0;
} Lobe;

inline Lobe lobe_of(__global const float *surface)
{
    Lobe o;
    float3 t, b;
    frame_about(row3(surface, NORMAL), &t, &b);
    o.t = triple(t);
    o.b = triple(b);
    o.n = triple(surface, NORMAL);
    Triple v = triple(surface, VIEW);
    o.e = unit(triple(inner(o.t, v), inner(o.b, v), larger(inner(o.n, v), 1e-3f)));
    o.alpha = surface[ALPHA];
    o.coat_alpha = surface[COAT_ALPHA];
    o.coat = surface[COAT];
    o.coat_f0 = surface[COAT_F_ZERO];
    return o;
}

inline Triple local_in(Lobe o, Triple d) { return triple(inner(o.t, d), inner(o.b, d), inner(o.n, d)); }
inline Triple world_from(Lobe o, Triple l) { return unit(plus(times(l.x, o.t), plus(times(l.y, o.b), times(l.z, o.n)))); }

/* weights of light from a direction, and the densities with which the lobe and the coat's lobe are drawn */
typedef struct {
    float x, y, a, b, coat, lobe_pdf, coat_pdf;
} Weights;

/* of l above the horizon; h: half vector */
inline Weights weights_of(Lobe o, Triple l, Triple h)
{
    float g = 1.0f - within(inner(o.e, h), 0.0f, 1.0f), g2 = g * g, f = g2 * g2 * g;
    float of_lobe[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    float lobe_pdf = model_weights(o.alpha, ggx_of_half(o.alpha, vector(h)), f, vector(o.e), vector(l), of_lobe);
    float dc = ggx_of_half(o.coat_alpha, vector(h));
    float has_coat = o.coat > 0.0f ? 1.0f : 0.0f; /* a factor, where a choice would be a branch */
    float coat = o.coat * (o.coat_f0 + (1.0f - o.coat_f0) * f) * dc * smith_visibility(o.coat_alpha, l.z, o.e.z) * l.z;
    float coat_pdf = has_coat * visible_pdf(o.coat_alpha, dc, o.e.z);
    Weights w = {of_lobe[0], of_lobe[1], of_lobe[2], of_lobe[3], coat, lobe_pdf, coat_pdf};
    return w;
}

/* radiance that a surface makes of light of radiance 1 from a direction, its weights times those of diffuse and of specular light */
inline float3 reflected(__global const float *surface, Weights w, float diffuse, float specular)
{
    float3 x = (float3)(diffuse * w.x), y = (float3)(diffuse * w.y), a = (float3)(specular * w.a), b = (float3)(specular * w.b);
    return of_columns(surface, x, y, a, b, (float3)(specular * w.coat));
}

/* a light direction l that visible normals of GGX mirror the eye to, and its half vector; visible_normal without calls */
inline void mirrored_by_ggx(float alpha, Triple e, float u, float v, Triple *l, Triple *h)
{
    Triple s = unit(triple(alpha * e.x, alpha * e.y, e.z));
    float z = (1.0f - v) * (1.0f + s.z) - s.z;
    float r = sqrt(within(1.0f - z * z, 0.0f, 1.0f));
    float2 c = cos_sin_of_turn(u);
    Triple m = plus(triple(r * c.x, r * c.y, z), s);
    *h = unit(triple(alpha * m.x, alpha * m.y, larger(m.z, 1e-6f)));
    *l = plus(times(2.0f * inner(e, *h), *h), times(-1.0f, e));
}

/* a light direction l of a lobe, and its half vector */
inline void mirrored_by(float alpha, Triple e, float u, float v, Triple *l, Triple *h)
{
#if MODEL == 0
    mirrored_by_ggx(alpha, e, u, v, l, h);
#else
    float3 light, half_vector;
    model_draw(alpha, vector(e), (float2)(u, v), &light, &half_vector);
    *l = triple(light);
    *h = triple(half_vector);
#endif
}

inline Triple cosine_direction(float u, float v)
{
    float2 c = cos_sin_of_turn(u);
    float r = sqrt(v);
    return triple(r * c.x, r * c.y, sqrt(larger(1.0f - v, 0.0f)));
}

/* ── the guide: where light comes from at an element, by blocks of bins in which directions are even; see usdslf/render/guide.py ── */

inline float guided_density(__global const float *guides, __global const float *frames, int element, Triple d)
{
    __global const float *q = frames + 9 * (size_t)element, *row = guides + (size_t)element * BLOCK_COUNT;
    Triple l = triple(inner(triple(q, 0), d), inner(triple(q, 3), d), inner(triple(q, 6), d));
    int b = within((int)block_of(quick_bin_of(l.x, l.y, l.z)), 0, BLOCK_COUNT - 1);
    float chance = row[b] - chance_before(row, b);
    return l.z > 0.0f ? chance * (BLOCK_COUNT / (2.0f * PI_F)) : 0.0f;
}

inline Triple guided_towards(__global const float *guides, __global const float *frames, int element, float u, float v)
{
    __global const float *row = guides + (size_t)element * BLOCK_COUNT, *q = frames + 9 * (size_t)element;
    int low = block_by_chance(row, u);
    float before = chance_before(row, low);
    float x = within((u - before) / larger(row[low] - before, 1e-12f), 0.0f, 0.9999999f);
    float a = (low % BLOCKS_ON_SIDE + x) * (2.0f / BLOCKS_ON_SIDE) - 1.0f;
    float b = (low / BLOCKS_ON_SIDE + v) * (2.0f / BLOCKS_ON_SIDE) - 1.0f;
    /* hemisphere_from_square of common.cl; |a| > |b| is not said so, which would put the two into a vector */
    int wide = (a - b) * (a + b) > 0.0f;
    float r = wide ? a : b, safe = r == 0.0f ? 1.0f : r;
    float turn = wide ? 0.125f * b / safe : 0.25f - 0.125f * a / safe;
    turn -= floor(turn);
    float2 c = cos_sin_of_turn(turn);
    float flat = r * sqrt(larger(2.0f - r * r, 0.0f));
    Triple across = plus(times(flat * c.x, triple(q, 0)), times(flat * c.y, triple(q, 3)));
    return plus(across, times(1.0f - r * r, triple(q, 6)));
}

/* where rays start: off the surface */
inline Triple start_of(__global const float *surface)
{
    return plus(triple(surface, POSITION), times(surface[LIFT], triple(surface, GEOMETRIC)));
}

/* a ray that only the shading normal sends out is folded up, else bumps would be black; returns whether it was */
inline int fold(Triple geometric, Triple *d)
{
    float below = inner(geometric, *d);
    *d = plus(*d, times(below < 0.0f ? -2.0f * below : 0.0f, geometric));
    return below < 0.0f;
}
