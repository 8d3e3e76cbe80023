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

inline float chance_before(__global const float *row, int b) { return b > 0 ? row[b - 1] : 0.0f; }

/* the first block whose cumulative chance exceeds u */
inline int block_by_chance(__global const float *row, float u)
{
    int low = 0, high = BLOCK_COUNT - 1;
    while (low < high) {
        int middle = (low + high) / 2;
        if (row[middle] > u) high = middle; else low = middle + 1;
    }
    return low;
}
