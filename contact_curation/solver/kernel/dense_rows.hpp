// Sums of long rows of numbers, and triangular factors that act on them.
#pragma once

#include <cmath>
#include <cstring>
#include <vector>

#include "cone_problem.hpp"

namespace contact_curation {

struct WeightedRow {
  const double *row;
  double weight;
};

// The same for so many vectors from number q on, which stay in registers while all rows are added to them.
template <int Packs>
inline void add_to_packs(const WeightedRow *rows, int count, double *into, int q) {
  Pack sums[Packs];
  for (int p = 0; p < Packs; ++p) std::memcpy(&sums[p], into + q + p * kPack, sizeof(Pack));
  for (int k = 0; k < count; ++k)
    for (int p = 0; p < Packs; ++p) {
      Pack row;
      std::memcpy(&row, rows[k].row + q + p * kPack, sizeof row);
      sums[p] += rows[k].weight * row;
    }
  for (int p = 0; p < Packs; ++p) std::memcpy(into + q + p * kPack, &sums[p], sizeof(Pack));
}

// into += weight * row, row after row, in whole vectors; `width` numbers at least.
inline void add_rows(const WeightedRow *rows, int count, double *into, int width) {
  int q = 0;
  for (; q + 3 * kPack < width; q += 4 * kPack) add_to_packs<4>(rows, count, into, q);
  if (q + 2 * kPack < width)
    add_to_packs<3>(rows, count, into, q);
  else if (q + kPack < width)
    add_to_packs<2>(rows, count, into, q);
  else if (q < width)
    add_to_packs<1>(rows, count, into, q);
}

// matrix += weight * row row^T, row after row; lower triangle in whole vectors (entries right of the diagonal are scratch).
inline void add_outers(const std::vector<WeightedRow> &rows, double *matrix, int stride) {
  WeightedRow used[12 + 3 * kMaxContacts];
  for (int a = 0; a < stride; ++a) {
    int count = 0;
    for (const WeightedRow &each : rows) {
      const double scaled = each.weight * each.row[a];
      if (scaled != 0.0) used[count++] = {each.row, scaled};
    }
    add_rows(used, count, matrix + static_cast<long>(a) * stride, a + 1);
  }
}

// Factors a matrix = L L^T in place: its lower triangle, `count` rows `width` apart. No square of a pivot is below `least`.
inline void factor(double *matrix, int width, int count, double least) {
  for (int a = 0; a < count; ++a) {
    double *row = matrix + a * width;
    for (int b = 0; b <= a; ++b) {
      const double *other = matrix + b * width;
      double value = row[b];
      for (int k = 0; k < b; ++k) value -= row[k] * other[k];
      row[b] = a == b ? std::sqrt(value > least ? value : least) : value / other[b];
    }
  }
}

// rows := L^-1 rows; there are `count` of them, of `length` numbers.
inline void solve_rows(const double *root, int width, int count, double *rows, int length) {
  for (int a = 0; a < count; ++a) {
    double *row = rows + static_cast<long>(a) * length;
    for (int b = 0; b < a; ++b) {
      const double *earlier = rows + static_cast<long>(b) * length, share = root[a * width + b];
      for (int q = 0; q < length; ++q) row[q] -= share * earlier[q];
    }
    for (int q = 0; q < length; ++q) row[q] /= root[a * width + a];
  }
}

}  // namespace contact_curation
