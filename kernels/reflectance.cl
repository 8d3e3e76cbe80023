/* reflectance.cl: the reflectance models, point by point; device twin of usdslf/reflectance.py.
 *
 * preview_surface (GGX, height-correlated Smith; the diffuse balance of OpenUSD's shader), at unit vectors of the local frame:
 *     L_o = d [(1 - F0) X + (1 - F90) Y] + F0 A + F90 B
 * with the integrands of the four columns
 *     x = (1 - f) c / pi,   y = f c / pi,   a = (1 - f) D V c,   b = f D V c,   f = (1 - E.H)^5,  c = N.L
 * phong (Nguyen et al. 2013, 5.2, normalized as Lafortune and Willems 1994):
 *     x = c / pi,  y = 0,  a = (n + 2) / (2 pi) <mirror(w), w'>^n c,  b = 0
 */
#include "common.cl"

/* GGX distribution; alpha = roughness^2.  Walter et al. 2007, Eq. 33 */
inline float ggx_distribution(float alpha, float nh)
{
    float a2 = alpha * alpha;
    /* 1 - nh^2 is lost to rounding near the peak of sharp lobes: callers pass nh of a normalized half vector */
    float t = (nh * a2) * nh + (1.0f - nh) * (1.0f + nh);
    return a2 / (PI_F * t * t);
}

/* G / (4 N.L N.E), height-correlated Smith.  Heitz 2014, Eq. 99 */
inline float smith_visibility(float alpha, float nl, float ne)
{
    float a2 = alpha * alpha;
    float le = sqrt(a2 + (1.0f - a2) * ne * ne);
    float ll = sqrt(a2 + (1.0f - a2) * nl * nl);
    return 0.5f / max(nl * le + ne * ll, 1e-9f);
}

/* the four columns' integrands (x, y, a, b) of preview_surface for directions e (eye) and l (light), both above the horizon */
inline float4 preview_surface_columns(float alpha, float3 e, float3 l)
{
    float nl = l.z, ne = max(e.z, 1e-4f);
    if (nl <= 0.0f) return (float4)(0.0f);
    float3 h = normalize(e + l);
    float f = pown(clamp(1.0f - dot(e, h), 0.0f, 1.0f), 5);
    float dvc = ggx_distribution(alpha, clamp(h.z, 0.0f, 1.0f)) * smith_visibility(alpha, nl, ne) * nl;
    float c = nl / PI_F;
    return (float4)((1.0f - f) * c, f * c, (1.0f - f) * dvc, f * dvc);
}

/* the same for phong with exponent n */
inline float4 phong_columns(float n, float3 e, float3 l)
{
    if (l.z <= 0.0f) return (float4)(0.0f);
    float m = max(e.z * l.z - e.x * l.x - e.y * l.y, 0.0f);
    return (float4)(l.z / PI_F, 0.0f, (n + 2.0f) / (2.0f * PI_F) * pow(m, n) * l.z, 0.0f);
}
