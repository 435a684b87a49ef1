#include "wheel/circulant.h"

#include <algorithm>
#include <cmath>

namespace fretwave::wheel {

namespace {

/// Adds up entries of one row at a time.
class RowSum {
 public:
  explicit RowSum(int columns) : columns_(columns) {}
  void add(int block, int column, double value) {
    auto& row = rows_[block];
    if (row.values.empty()) row.values.assign(columns_, 0.0), row.taken.assign(columns_, 0);
    if (!row.taken[column]) row.taken[column] = 1, row.columns.push_back(column);
    row.values[column] += value;
  }
  /// The row ends: it is that of so high a number of all blocks.
  void end(int number, Circulant<SparseBlock>& to) {
    for (auto& [k, row] : rows_) {
      SparseBlock& block = to[k];
      block.first.resize(number + 1, block.first.back());
      std::ranges::sort(row.columns);
      for (const int column : row.columns) {
        block.columns.push_back(column), block.values.push_back(row.values[column]);
        row.values[column] = 0, row.taken[column] = 0;
      }
      block.first.push_back(int(block.columns.size()));
      row.columns.clear();
    }
  }

 private:
  struct Row {
    std::vector<double> values;
    std::vector<char> taken;
    std::vector<int> columns;
  };
  int columns_;
  std::map<int, Row> rows_;
};

void fill_up(Circulant<SparseBlock>& blocks, int rows) {
  for (auto& [k, A] : blocks) A.first.resize(size_t(rows) + 1, A.first.back());
}

/// Whether all ranks with entries have them where rank 0 has; those without take its places. Collective.
bool alike(Circulant<SparseBlock>& blocks, int rows, MPI_Comm comm) {
  std::vector<int> pattern;
  for (auto const& [k, A] : blocks) {
    pattern.insert(pattern.end(), {k, int(A.columns.size())});
    pattern.insert(pattern.end(), A.first.begin(), A.first.end());
    pattern.insert(pattern.end(), A.columns.begin(), A.columns.end());
  }
  auto first = pattern;
  broadcast(first, 0, comm);
  int same = blocks.empty() || pattern == first;
  MPI_Allreduce(MPI_IN_PLACE, &same, 1, MPI_INT, MPI_LAND, comm);
  if (!same || !blocks.empty()) return same;
  for (auto at = first.begin(); at != first.end();) {
    SparseBlock& A = blocks[*at];
    const int entries = *(at + 1);
    at += 2;
    A.first.assign(at, at + rows + 1), at += rows + 1;
    A.columns.assign(at, at + entries), at += entries;
    A.values.assign(entries, 0.0);
  }
  return true;
}

struct Entry {
  int row, block, column;
  double value;
};

/// The blocks of all ranks added up, on every rank. Collective.
Circulant<SparseBlock> over_ranks(Circulant<SparseBlock> mine, int rows, MPI_Comm comm) {
  if (comm_size(comm) == 1) return mine;
  if (alike(mine, rows, comm)) {
    for (auto& [k, A] : mine) sum_over_ranks(A.values, comm);
    return mine;
  }
  std::vector<Entry> own;
  for (auto const& [k, A] : mine)
    for_entries(A, [&](int row, int column, double value) { own.push_back({row, k, column, value}); });
  auto all = gathered(std::span<Entry const>(own), comm);
  std::ranges::stable_sort(all, {}, &Entry::row);
  Circulant<SparseBlock> out;
  RowSum row(rows);
  auto at = all.begin();
  for (int number = 0; number < rows; ++number) {
    for (; at != all.end() && at->row == number; ++at) row.add(at->block, at->column, at->value);
    row.end(number, out);
  }
  fill_up(out, rows);
  return out;
}

SparseBlock transposed(SparseBlock const& A) {
  SparseBlock out;
  out.first.assign(size_t(A.rows()) + 1, 0);
  out.columns.resize(A.columns.size()), out.values.resize(A.values.size());
  for (const int column : A.columns) ++out.first[column + 1];
  for (int row = 0; row < A.rows(); ++row) out.first[row + 1] += out.first[row];
  auto next = out.first;
  for_entries(A, [&](int row, int column, double value) {
    const int at = next[column]++;
    out.columns[at] = row, out.values[at] = value;
  });
  return out;
}

SparseBlock sum(SparseBlock const& A, double c, SparseBlock const& B) {
  SparseBlock out;
  for (int row = 0; row < A.rows(); ++row) {
    int a = A.first[row], b = B.first[row];
    while (a < A.first[row + 1] || b < B.first[row + 1]) {
      const bool from_a = a < A.first[row + 1] && (b == B.first[row + 1] || A.columns[a] <= B.columns[b]);
      const bool from_b = b < B.first[row + 1] && (a == A.first[row + 1] || B.columns[b] <= A.columns[a]);
      out.columns.push_back(from_a ? A.columns[a] : B.columns[b]);
      out.values.push_back((from_a ? A.values[a] : 0.0) + (from_b ? c * B.values[b] : 0.0));
      a += from_a, b += from_b;
    }
    out.first.push_back(int(out.columns.size()));
  }
  return out;
}

double largest(SparseBlock const& A) {
  double size = 0;
  for (const double a : A.values) size = std::max(size, std::abs(a));
  return size;
}

}  // namespace

Circulant<SparseBlock> mean_blocks(Mat A, int unit, int sectors, std::vector<int> const& place) {
  MPI_Comm comm;
  PetscInt begin, end;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(A), &comm));
  check(MatGetOwnershipRange(A, &begin, &end));
  std::vector<int> dof(unit);
  for (int i = 0; i < unit; ++i) dof[place[i]] = i;
  Circulant<SparseBlock> mine;
  RowSum sum(unit);
  for (int number = 0; number < unit; ++number) {
    for (PetscInt row = begin + dof[number]; row < end; row += unit) {
      PetscInt count;
      PetscInt const* cols;
      PetscScalar const* values;
      check(MatGetRow(A, row, &count, &cols, &values));
      for (PetscInt k = 0; k < count; ++k)
        sum.add(int(cols[k] / unit - row / unit + sectors) % sectors, place[cols[k] % unit],
                values[k] / sectors);
      check(MatRestoreRow(A, row, &count, &cols, &values));
    }
    sum.end(number, mine);
  }
  fill_up(mine, unit);
  return over_ranks(std::move(mine), unit, comm);
}

bool symmetric(Circulant<SparseBlock> const& blocks, int sectors) {
  double size = 0, change = 0;
  for (auto const& [k, A] : blocks) {
    const auto other = blocks.find((sectors - k) % sectors);
    if (other == blocks.end()) return false;
    size = std::max(size, largest(A));
    change = std::max(change, largest(sum(A, -1, transposed(other->second))));
  }
  return change <= 1e-9 * size;
}

std::vector<complex> multiply(Circulant<SparseBlock> const& A, int diameter, int sectors, complex const* x) {
  std::vector<complex> y(A.empty() ? 0 : A.begin()->second.rows());
  for (auto const& [k, block] : A) {
    const auto t = turn(k, diameter, sectors);
    for (int row = 0; row < block.rows(); ++row) {
      complex sum = 0;
      for (int at = block.first[row]; at < block.first[row + 1]; ++at)
        sum += block.values[at] * x[block.columns[at]];
      y[row] += t * sum;
    }
  }
  return y;
}

Circulant<SparseBlock> sum(Circulant<SparseBlock> const& A, double c, Circulant<SparseBlock> const& B) {
  Circulant<SparseBlock> out = A;
  for (auto const& [k, block] : B) {
    auto& to = out[k];
    fill_up(out, block.rows());
    to = sum(to, c, block);
  }
  return out;
}

}  // namespace fretwave::wheel
