#include "contact_tangent.h"

#include <cmath>
#include <vector>

#include "wide.h"

namespace swgjoint {
namespace {

using Values = std::vector<double>;

// Displacement of a contact along a direction per coordinate of its sector. rows:
// displacements of the nodes of its flank (nodes, 2, m).
SWGJOINT_INLINE void displace(const double* rows, const double* weights,
                              std::size_t nodes, std::size_t m, double x, double y,
                              double* __restrict result) {
  for (std::size_t i = 0; i < m; ++i) result[i] = 0.0;
  for (std::size_t k = 0; k < nodes; ++k, rows += 2 * m) {
    const double along = weights[k] * x, across = weights[k] * y;
    for (std::size_t i = 0; i < m; ++i) {
      result[i] += along * rows[i] + across * rows[m + i];
    }
  }
}

// Adds the lever arm of the turning frame, less the turn of the displaced nodes.
SWGJOINT_INLINE void turn_with_frame(double lever, const double* j_y, const double* spin,
                                     std::size_t m, double* __restrict result) {
  const double turned = lever - sum_of_products(result, j_y, m);
  for (std::size_t i = 0; i < m; ++i) result[i] += turned * spin[i];
}

void rotate(double cos, double sin, std::size_t m, double* values) {
  for (std::size_t i = 0; i + 1 < m; i += 2) {
    const double x = values[i], y = values[i + 1];
    values[i] = cos * x - sin * y;
    values[i + 1] = sin * x + cos * y;
  }
}

}  // namespace

SWGJOINT_WIDE void add_contact_tangents(const double* carried, std::size_t nodes,
                                        std::size_t m, const Turning& turning,
                                        const Loaded& loaded, const std::int64_t* dofs,
                                        std::size_t n, double* tangent) {
  Values vectors(5 * m), j_y(m), row(m);
  double *gamma = vectors.data(), *slide = gamma + m, *w = slide + m, *beside = w + m;
  double* turn = beside + m;
  for (std::size_t c = 0; c < loaded.count; ++c) {
    const auto sector = static_cast<std::size_t>(loaded.sector[c]);
    const auto side = static_cast<std::size_t>(loaded.side[c]);
    const double *spin = turning.spin + m * sector, *y = turning.position + m * sector;
    const double* rows = carried + 2 * nodes * m * side;
    const double *weights = loaded.weights + nodes * c, *slopes = loaded.slopes + nodes * c;
    const double nx = loaded.normal[2 * c], ny = loaded.normal[2 * c + 1];
    const double* number = loaded.numbers + 6 * c;
    const double height = number[0], lever = number[1], slope = number[2];
    for (std::size_t i = 0; i < m; i += 2) {
      j_y[i] = -y[i + 1];
      j_y[i + 1] = y[i];
    }
    // along the tangent J n, then the turn of the flank
    displace(rows, weights, nodes, m, -ny, nx, slide);
    turn_with_frame(0.0, j_y.data(), spin, m, slide);
    displace(rows, slopes, nodes, m, nx, ny, turn);
    turn_with_frame(-slope, j_y.data(), spin, m, turn);
    for (std::size_t i = 0; i < m; i += 2) {
      // the spin is that of the places of the face nodes, turned by a right angle
      w[i] = -0.5 * height * spin[i] - slide[i] - lever * spin[i + 1];
      w[i + 1] = -0.5 * height * spin[i + 1] - slide[i + 1] + lever * spin[i];
    }
    for (std::size_t i = 0; i < m; ++i) {
      gamma[i] = spin[i];
      slide[i] += height * spin[i];
      beside[i] = 0.5 * number[3] * slide[i] + number[4] * turn[i];
    }
    const double angle = turning.angle[sector];
    rotate(std::cos(angle), std::sin(angle), 5 * m, vectors.data());
    double* of_sector = tangent + n * n * sector;
    for (std::size_t i = 0; i < m; ++i) {
      const double g = gamma[i], s = slide[i], v = w[i], b = beside[i];
      const double t = number[5] * turn[i];
      double* __restrict sum = row.data();
      for (std::size_t j = 0; j < m; ++j) {
        sum[j] = g * w[j] + v * gamma[j] + s * beside[j] + b * slide[j] + t * turn[j];
      }
      double* to = of_sector + n * static_cast<std::size_t>(dofs[i]);
      for (std::size_t j = 0; j < m; ++j) to[dofs[j]] -= loaded.force[c] * sum[j];
    }
  }
}

}  // namespace swgjoint
