// Dense sums behind the tangent of a drive: springs of bore stations, displacements of
// a ring of teeth and compliance between its points.

#ifndef SWGJOINT_KERNELS_TANGENTS_H_
#define SWGJOINT_KERNELS_TANGENTS_H_

#include <cstddef>
#include <cstdint>

namespace swgjoint {

// Twin of BoreStations.stiffness_of in swgjoint/fe/plane/bore_contact.py, added to
// result (count, size, size): weights (p, 2, width), direction (count, q, 2),
// stiffness (count, q), with q = p times the number of intervals.
void add_station_stiffness(const double* weights, std::size_t p, std::size_t width,
                           const double* direction, const double* stiffness,
                           std::size_t count, std::size_t intervals, double* result);

// Add blocks (count, size, size) in given rows and columns (size,) of matrices
// (count, full, full).
void add_blocks(const double* blocks, std::size_t count, std::size_t size,
                const std::int64_t* into, double* result, std::size_t full);

// Twin of respond in swgjoint/fe/common/block_circulant.py, added to result
// (teeth, rows): offsets (count,), blocks (count, rows, size), force (teeth, size).
void respond(const std::int64_t* offsets, const double* blocks, std::size_t count,
             std::size_t rows, std::size_t size, const double* force, std::size_t teeth,
             double* result);

// Twin of contact_compliance in swgjoint/fe/common/block_circulant.py, result (n, n):
// block_of: first block of a tooth offset (teeth,), after: next one of the same offset
// (n_blocks,), larger than the one before, -1 for none; blocks (n_blocks, size, size),
// tooth (n,), weight (n, size). The blocks are reciprocal: that of the opposite offset is
// the transpose.
void contact_compliance(const std::int64_t* block_of, std::size_t teeth,
                        const std::int64_t* after, const double* blocks, std::size_t size,
                        const std::int64_t* tooth, const double* weight, std::size_t n,
                        double* result);

}  // namespace swgjoint

#endif  // SWGJOINT_KERNELS_TANGENTS_H_
