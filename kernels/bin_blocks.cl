/* bin_blocks.cl: blocks of bins, which wide rays and the guide of rays take together.  Build constant: BLOCK, bins
 * on the side of one. */
#include "common.cl"

#define BLOCKS_ON_SIDE (SIDE / BLOCK)
#define BLOCK_COUNT (BLOCKS_ON_SIDE * BLOCKS_ON_SIDE) /* of an element */

#define BLOCK_OF(bin) ((bin) / SIDE / BLOCK * BLOCKS_ON_SIDE + (bin) % SIDE / BLOCK) /* of one, or of several side by side */
inline uint block_of(uint bin) { return BLOCK_OF(bin); }

/* the bin of column x and row y in block b */
inline int bin_in_block(uint b, uint x, uint y)
{
    return (b / BLOCKS_ON_SIDE * BLOCK + y) * SIDE + b % BLOCKS_ON_SIDE * BLOCK + x;
}

/* A guide's row holds the cumulative chances of an element's blocks. */

inline float chance_before(__global const float *row, int b)
{
    float before = row[b > 0 ? b - 1 : 0];
    return b > 0 ? before : 0.0f;
}

/* the first block whose cumulative chance exceeds u, or the last */
inline int block_by_chance(__global const float *row, float u)
{
    int low = 0;
    #pragma unroll
    for (int step = BLOCK_COUNT / 2; step > 0; step /= 2) low += row[low + step - 1] > u ? 0 : step;
    return low;
}
