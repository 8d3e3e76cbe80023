/* lobes.cl: directions drawn from the lobes of a surface, and the weights of directions.
 *
 * A ray's five weights are the integrands of (X, Y, A, B, coat) of reflectance.cl.  Build constant MODEL.
 */
#include "reflectance.cl"
#include "low_discrepancy.cl"
#include "guided_directions.cl"

#define WEIGHTS 5

/* points (n, 2) of a sequence at given indices */
__kernel void sequence_points(
    const uint n,                  /* points */
    const uint seed,               /* which sequence */
    __global const uint *index,    /* (n) */
    __global float *point)         /* (n, 2) out */
{
    size_t i = get_global_id(0);
    if (i >= n) return;
    vstore2(sobol(index[i], seed), i, point);
}

/* weights (5) of light direction l seen from e, and the density of the mixture of lobes that draws it.
 * lobes: alpha, alpha of the coat, chance of the specular lobe, chance of the coat; coat: its strength, its F0.
 * h: half vector. */
inline float lobe_weights(float4 lobes, float2 coat, float3 e, float3 l, float3 h, float *w)
{
    float nl = l.z, ne = e.z;
    for (int i = 0; i < WEIGHTS; i++) w[i] = 0.0f;
    if (nl <= 0.0f) return 0.0f;
    float eh = clamp(dot(e, h), 0.0f, 1.0f);
    float f = pown(1.0f - eh, 5);
    float d = ggx_of_half(lobes.x, h);
    float c = nl / PI_F;
    float lobe_pdf = model_weights(lobes.x, d, f, e, l, w);
    float pdf = (1.0f - lobes.z - lobes.w) * c + lobes.z * lobe_pdf;
    if (coat.x > 0.0f) {
        float dc = ggx_of_half(lobes.y, h);
        w[4] = coat.x * (coat.y + (1.0f - coat.y) * f) * dc * smith_visibility(lobes.y, nl, ne) * nl;
        pdf += lobes.w * visible_pdf(lobes.y, dc, ne);
    }
    return pdf;
}

/* eye in the frame (t, b, n), kept above the horizon */
inline float3 local_eye(float3 t, float3 b, float3 n, float3 v)
{
    float3 e = (float3)(dot(t, v), dot(b, v), max(dot(n, v), 1e-3f));
    return normalize(e);
}

/* density of the mixture when the share g of its cosine lobe is drawn from a guide */
inline float with_guide(float pdf, float4 lobes, float nl, float g, int element, __global const float *guides,
                        __global const float *frames, float3 d)
{
    if (g <= 0.0f || nl <= 0.0f) return pdf;
    float wide = (1.0f - lobes.z - lobes.w) * g;
    float guide = guide_density(guides + (size_t)element * BLOCK_COUNT, frames, element, d);
    return pdf + wide * (guide - nl / PI_F);
}

/* draws k directions at each of n points from the mixture of their lobes */
__kernel void sample_lobes(
    const uint n,                   /* points */
    const uint k,                   /* directions of each point */
    const uint seed,                /* sequence */
    __global const uint *index,     /* (n) first index of each point in the sequence; it takes k of them */
    __global const float *normal,   /* (n, 3) */
    __global const float *view,     /* (n, 3) towards the viewer */
    __global const float *lobes,    /* (n, 4) alpha, coat alpha, chance of specular, chance of coat */
    __global const float *coat,     /* (n, 2) strength, F0 */
    __global const int *element,    /* (n) whose guide is used; negative: none */
    __global const float *guides,   /* (N, blocks) */
    __global const float *frames,   /* (N, 3, 3) of elements */
    const float guided,             /* share of the rays of wide lobes */
    __global float *direction,      /* (n, k, 3) out: world */
    __global float *pdf,            /* (n, k) out: 1/sr; 0 where below the horizon */
    __global float *lobe_pdf,       /* (n, k) out: the same without the guide */
    __global float *weight)         /* (n, k, 5) out: integrands over pdf */
{
    size_t i = get_global_id(0);
    if (i >= (size_t)n * k) return;
    size_t p = i / k;
    float3 nn = load3(normal, p), t, b;
    frame_about(nn, &t, &b);
    float3 e = local_eye(t, b, nn, load3(view, p));
    float4 lob = vload4(p, lobes);
    float2 u = sobol(index[p] + (uint)(i % k), seed);
    int e_ = element[p];
    float g = e_ < 0 ? 0.0f : guided;
    float3 l, h;
    float first = lob.z, second = lob.z + lob.w;
    if (u.x < second) {
        int spec = u.x < first;
        u.x = spec ? u.x / first : (u.x - first) / lob.w;
        model_draw(spec ? lob.x : lob.y, e, u, &l, &h);
    } else {
        u.x = min((u.x - second) / (1.0f - second), 0.99999994f);
        if (u.x < g) {
            float3 d = guided_direction(guides + (size_t)e_ * BLOCK_COUNT, frames, e_, (float2)(u.x / g, u.y));
            l = (float3)(dot(t, d), dot(b, d), dot(nn, d));
        } else {
            u.x = min((u.x - g) / (1.0f - g), 0.99999994f);
            float r = sqrt(u.y), phi = 2.0f * PI_F * u.x;
            l = (float3)(r * cos(phi), r * sin(phi), sqrt(max(1.0f - u.y, 0.0f)));
        }
        h = normalize(e + l);
    }
    float w[WEIGHTS];
    float3 world = normalize(l.x * t + l.y * b + l.z * nn);
    store3(world, direction, i);
    lobe_pdf[i] = lobe_weights(lob, vload2(p, coat), e, l, h, w);
    float q = with_guide(lobe_pdf[i], lob, l.z, g, e_, guides, frames, world);
    pdf[i] = q;
    float scale = q > 0.0f ? 1.0f / q : 0.0f;
    for (int c = 0; c < WEIGHTS; c++) weight[i * WEIGHTS + c] = w[c] * scale;
}

/* weights and density of given directions, one for each of n points */
__kernel void evaluate_lobes(
    const uint n,                   /* points */
    __global const float *normal,   /* (n, 3) */
    __global const float *view,     /* (n, 3) */
    __global const float *lobes,    /* (n, 4) */
    __global const float *coat,     /* (n, 2) */
    __global const int *element,    /* (n) */
    __global const float *guides,   /* (N, blocks) */
    __global const float *frames,   /* (N, 3, 3) */
    const float guided,
    __global const float *direction, /* (n, 3) towards the light */
    __global float *pdf,            /* (n) out */
    __global float *weight)         /* (n, 5) out: integrands */
{
    size_t i = get_global_id(0);
    if (i >= n) return;
    float3 nn = load3(normal, i), t, b;
    frame_about(nn, &t, &b);
    float3 e = local_eye(t, b, nn, load3(view, i));
    float3 d = load3(direction, i);
    float3 l = (float3)(dot(t, d), dot(b, d), dot(nn, d));
    float w[WEIGHTS];
    float4 lob = vload4(i, lobes);
    float q = lobe_weights(lob, vload2(i, coat), e, l, normalize(e + l), w);
    pdf[i] = with_guide(q, lob, l.z, element[i] < 0 ? 0.0f : guided, element[i], guides, frames, d);
    for (int c = 0; c < WEIGHTS; c++) weight[i * WEIGHTS + c] = w[c];
}
