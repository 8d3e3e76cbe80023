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
