/* live_lobes.cl: the directions that a surface of a live picture sends rays in, and how likely each is: its lobes, and the guide
 * that says where light comes from. */
#include "live_sources.cl"
#include "bin_blocks.cl"

#define WEIGHTS 5

/* ── lobes ── */

typedef struct {
    float3 t, b, n, e; /* frame of the shading normal, and the eye in it */
    float alpha, coat_alpha, coat, coat_f0;
} Lobe;

inline Lobe lobe_of(__global const float *surface)
{
    Lobe o;
    o.n = row3(surface, NORMAL);
    frame_about(o.n, &o.t, &o.b);
    float3 v = row3(surface, VIEW);
    o.e = unit((float3)(inner(o.t, v), inner(o.b, v), larger(inner(o.n, v), 1e-3f)));
    o.alpha = surface[ALPHA];
    o.coat_alpha = surface[COAT_ALPHA];
    o.coat = surface[COAT];
    o.coat_f0 = surface[COAT_F_ZERO];
    return o;
}

inline float3 local_in(Lobe o, float3 d) { return (float3)(inner(o.t, d), inner(o.b, d), inner(o.n, d)); }
inline float3 world_from(Lobe o, float3 l) { return unit(l.x * o.t + l.y * o.b + l.z * o.n); }

/* weights (5) of light from l, and the densities with which the lobe and the coat's lobe are drawn */
inline void weights_of(Lobe o, float3 l, float3 h, float *w, float *lobe_pdf, float *coat_pdf)
{
    #pragma unroll
    for (int k = 0; k < WEIGHTS; k++) w[k] = 0.0f;
    *lobe_pdf = *coat_pdf = 0.0f;
    if (l.z <= 0.0f) return;
    float g = 1.0f - within(inner(o.e, h), 0.0f, 1.0f), g2 = g * g, f = g2 * g2 * g;
    *lobe_pdf = model_weights(o.alpha, ggx_of_half(o.alpha, h), f, o.e, l, w);
    if (o.coat > 0.0f) {
        float dc = ggx_of_half(o.coat_alpha, h);
        w[4] = o.coat * (o.coat_f0 + (1.0f - o.coat_f0) * f) * dc * smith_visibility(o.coat_alpha, l.z, o.e.z) * l.z;
        *coat_pdf = visible_pdf(o.coat_alpha, dc, o.e.z);
    }
}

/* a light direction l that visible normals of GGX mirror the eye to, and its half vector; visible_normal without calls */
inline void mirrored_by_ggx(float alpha, float3 e, float2 u, float3 *l, float3 *h)
{
    float3 s = unit((float3)(alpha * e.x, alpha * e.y, e.z));
    float z = (1.0f - u.y) * (1.0f + s.z) - s.z;
    float r = sqrt(within(1.0f - z * z, 0.0f, 1.0f));
    float2 c = r * cos_sin_of_turn(u.x);
    float3 m = (float3)(c.x, c.y, z) + s;
    *h = unit((float3)(alpha * m.x, alpha * m.y, larger(m.z, 1e-6f)));
    *l = 2.0f * inner(e, *h) * *h - e;
}

/* a light direction l of a lobe, and its half vector */
inline void mirrored_by(float alpha, float3 e, float2 u, float3 *l, float3 *h)
{
#if MODEL == 0
    mirrored_by_ggx(alpha, e, u, l, h);
#else
    model_draw(alpha, e, u, l, h);
#endif
}

inline float3 cosine_direction(float2 u)
{
    return (float3)(sqrt(u.y) * cos_sin_of_turn(u.x), sqrt(larger(1.0f - u.y, 0.0f)));
}

/* ── the guide: where light comes from at an element, by blocks of bins in which directions are even; see usdslf/render/guide.py ── */

inline float guided_density(__global const float *guides, __global const float *frames, int element, float3 d)
{
    float3 l = local_from_world(frames, element, d);
    if (!(l.z > 0.0f)) return 0.0f;
    __global const float *row = guides + (size_t)element * BLOCK_COUNT;
    int b = block_of(quick_bin_of(l));
    return (row[b] - chance_before(row, b)) * (BLOCK_COUNT / (2.0f * PI_F));
}

inline float3 guided_towards(__global const float *guides, __global const float *frames, int element, float2 u)
{
    __global const float *row = guides + (size_t)element * BLOCK_COUNT;
    int low = block_by_chance(row, u.x);
    float before = chance_before(row, low);
    float x = within((u.x - before) / larger(row[low] - before, 1e-12f), 0.0f, 0.9999999f);
    float a = (low % BLOCKS_ON_SIDE + x) * (2.0f / BLOCKS_ON_SIDE) - 1.0f;
    float b = (low / BLOCKS_ON_SIDE + u.y) * (2.0f / BLOCKS_ON_SIDE) - 1.0f;
    /* hemisphere_from_square of common.cl */
    int wide = fabs(a) > fabs(b);
    float r = wide ? a : b, safe = r == 0.0f ? 1.0f : r;
    float turn = wide ? 0.125f * b / safe : 0.25f - 0.125f * a / safe;
    turn -= floor(turn);
    float2 c = r * sqrt(larger(2.0f - r * r, 0.0f)) * cos_sin_of_turn(turn);
    return world_from_local(frames, element, (float3)(c, 1.0f - r * r));
}

/* where rays start: off the surface */
inline float3 start_of(__global const float *surface)
{
    return row3(surface, POSITION) + surface[LIFT] * row3(surface, GEOMETRIC);
}

/* a ray that only the shading normal sends out is folded up, else bumps would be black; returns whether it was */
inline int fold(float3 geometric, float3 *d)
{
    float below = inner(geometric, *d);
    if (below < 0.0f) *d -= 2.0f * below * geometric;
    return below < 0.0f;
}
