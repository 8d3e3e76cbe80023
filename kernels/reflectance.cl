/* reflectance.cl: the reflectance models, point by point; device twin of usdslf/surfaces/reflectance.py.
 *
 * preview_surface (GGX, height-correlated Smith; the diffuse balance of OpenUSD's shader), at unit vectors of the local frame:
 *     L_o = d [(1 - F0) X + (1 - F90) Y] + F0 A + F90 B
 * with the integrands of the four columns
 *     x = (1 - f) c / pi,   y = f c / pi,   a = (1 - f) D V c,   b = f D V c,   f = (1 - E.H)^5,  c = N.L
 * phong (Nguyen et al. 2013, 5.2, normalized as Lafortune and Willems 1994):
 *     x = c / pi,  y = 0,  a = (n + 2) / (2 pi) <mirror(w), w'>^n c,  b = 0
 */
#include "common.cl"
#include "visible_normals.cl"

/* GGX distribution; alpha = roughness^2.  Walter et al. 2007, Eq. 33.
 * 1 - nh^2 is taken as a product: near the peak of a sharp lobe the difference would be lost to rounding. */
#define DEFINE_GGX(F, NAME)                                                                                              \
    inline F NAME(F alpha, F nh)                                                                                         \
    {                                                                                                                    \
        F a2 = alpha * alpha;                                                                                            \
        F t = (nh * a2) * nh + (1.0f - nh) * (1.0f + nh);                                                                \
        return a2 / (PI_F * t * t);                                                                                      \
    }

/* G / (4 N.L N.E), height-correlated Smith.  Heitz 2014, Eq. 99 */
#define DEFINE_SMITH(F, NAME)                                                                                            \
    inline F NAME(F alpha, F nl, F ne)                                                                                   \
    {                                                                                                                    \
        F a2 = alpha * alpha;                                                                                            \
        F le = sqrt(a2 + (1.0f - a2) * ne * ne);                                                                         \
        F ll = sqrt(a2 + (1.0f - a2) * nl * nl);                                                                         \
        return 0.5f / max(nl * le + ne * ll, (F)1e-9f);                                                                  \
    }

/* the four columns' integrands of preview_surface for local unit directions e (eye) and l (light); zero below the horizon */
#define DEFINE_PREVIEW_SURFACE(F, NAME, GGX, SMITH)                                                                      \
    inline void NAME(F alpha, F ex, F ey, F ez, F lx, F ly, F lz, F *x, F *y, F *a, F *b)                                \
    {                                                                                                                    \
        F nl = max(lz, (F)0.0f), ne = max(ez, (F)1e-4f);                                                                 \
        F hx = ex + lx, hy = ey + ly, hz = ez + lz;                                                                      \
        F s = rsqrt(max(hx * hx + hy * hy + hz * hz, (F)1e-20f));                                                        \
        F g = 1.0f - clamp((ex * hx + ey * hy + ez * hz) * s, (F)0.0f, (F)1.0f);                                         \
        F f = g * g * g * g * g;                                                                                         \
        F dvc = GGX(alpha, clamp(hz * s, (F)0.0f, (F)1.0f)) * SMITH(alpha, nl, ne) * nl;                                 \
        F c = nl / PI_F;                                                                                                 \
        *x = (1.0f - f) * c; *y = f * c; *a = (1.0f - f) * dvc; *b = f * dvc;                                            \
    }

/* the same for phong with exponent n */
#define DEFINE_PHONG(F, NAME)                                                                                            \
    inline void NAME(F n, F ex, F ey, F ez, F lx, F ly, F lz, F *x, F *y, F *a, F *b)                                    \
    {                                                                                                                    \
        F nl = max(lz, (F)0.0f);                                                                                         \
        F m = max(ez * lz - ex * lx - ey * ly, (F)0.0f);                                                                 \
        *x = nl / PI_F; *y = (F)0.0f; *a = (n + 2.0f) / (2.0f * PI_F) * pow(m, n) * nl; *b = (F)0.0f;                    \
    }

DEFINE_GGX(float, ggx_distribution)
DEFINE_SMITH(float, smith_visibility)
DEFINE_PREVIEW_SURFACE(float, preview_surface_into, ggx_distribution, smith_visibility)
DEFINE_PHONG(float, phong_into)

inline float4 preview_surface_columns(float alpha, float3 e, float3 l)
{
    float x, y, a, b;
    preview_surface_into(alpha, e.x, e.y, e.z, l.x, l.y, l.z, &x, &y, &a, &b);
    return (float4)(x, y, a, b);
}

inline float4 phong_columns(float n, float3 e, float3 l)
{
    float x, y, a, b;
    phong_into(n, e.x, e.y, e.z, l.x, l.y, l.z, &x, &y, &a, &b);
    return (float4)(x, y, a, b);
}

/* of the renderer: a direction l that a lobe mirrors the eye to, its half vector h, and the density of such directions; and the
 * weights (4) of a direction in which the colours d, F0, F90 are reflected, with the distribution and the ramp at hand */

inline void preview_surface_draw(float alpha, float3 e, float2 u, float3 *l, float3 *h)
{
    *h = visible_normal(alpha, e, u);
    *l = 2.0f * dot(e, *h) * *h - e;
}

inline float preview_surface_weights(float alpha, float ggx, float f, float3 e, float3 l, float *w)
{
    float c = l.z / PI_F;
    float dvc = ggx * smith_visibility(alpha, l.z, e.z) * l.z;
    w[0] = (1.0f - f) * c;
    w[1] = f * c;
    w[2] = (1.0f - f) * dvc;
    w[3] = f * dvc;
    return visible_pdf(alpha, ggx, e.z);
}

/* of phong: the exponent (phong_exponent of usdslf/surfaces/reflectance.py), and the density of cos^n about the mirrored eye */
inline float exponent_of(float alpha) { return clamp(0.5f / (alpha * alpha) - 0.5f, 1e-3f, 1e6f); }

inline float phong_pdf(float n, float3 e, float3 l)
{
    return (n + 1.0f) / (2.0f * PI_F) * pow(max(e.z * l.z - e.x * l.x - e.y * l.y, 0.0f), n);
}

inline void phong_draw(float alpha, float3 e, float2 u, float3 *l, float3 *h)
{
    float n = exponent_of(alpha);
    float c = pow(1.0f - u.y, 1.0f / (n + 1.0f)), s = sqrt(max(1.0f - c * c, 0.0f)), phi = 2.0f * PI_F * u.x;
    float3 m = (float3)(-e.x, -e.y, e.z), t, b;
    frame_about(m, &t, &b);
    *l = s * cos(phi) * t + s * sin(phi) * b + c * m;
    *h = normalize(e + *l);
}

/* (0, X, A, 0), which F90 = 0 turns into k_d X + k_s A */
inline float phong_weights(float alpha, float ggx, float f, float3 e, float3 l, float *w)
{
    float n = exponent_of(alpha);
    float4 column = phong_columns(n, e, l);
    w[1] = column.x;
    w[2] = column.z;
    return phong_pdf(n, e, l);
}

/* ── the model that is built: MODEL is its number in usdslf/surfaces/reflectance.py ── */
#ifndef MODEL
#define MODEL 0
#endif
#if MODEL == 0
#define HAS_FRESNEL 1
#define DEFINE_MODEL DEFINE_PREVIEW_SURFACE
#define model_columns preview_surface_columns
#define model_draw preview_surface_draw
#define model_weights preview_surface_weights
#else
#define HAS_FRESNEL 0
#define DEFINE_MODEL(F, NAME, GGX, SMITH) DEFINE_PHONG(F, NAME)
#define model_columns phong_columns
#define model_draw phong_draw
#define model_weights phong_weights
#endif
