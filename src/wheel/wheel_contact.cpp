#include "wheel/wheel_contact.h"

#include <algorithm>
#include <map>
#include <numeric>

#include "lapack.h"

namespace fretwave::wheel {

namespace {

constexpr int most_together = 1500;  // coefficients: 9 MB a sector, LAPACK's elimination in 0.2 s

}  // namespace

WheelContact::WheelContact(HarmonicProblem const& problem, SectorTransform const& sectors)
    : harmonics_(problem.harmonics()), sectors_(sectors), comm_(problem.comm()), exchange_(comm_) {
  const int rank = comm_rank(comm_);
  own_sectors_ = sectors.first_sector(rank + 1) - sectors.first_sector(rank);
  for (auto const& contact : problem.model().contacts()) {
    int pairs = contact.law->pairs();
    MPI_Allreduce(MPI_IN_PLACE, &pairs, 1, MPI_INT, MPI_SUM, comm_);
    first_pair_.push_back(pairs_.size());
    numbers_.push_back(contact.numbers);
    const int d = contact.law->components();
    for (int k = 0; k < pairs / sectors.sectors(); ++k, rows_ += d) pairs_.push_back({rows_, d, 0});
  }
  first_pair_.push_back(pairs_.size());
  size_t next = 0;
  for (Pair& pair : pairs_) {
    pair.first_tangent = next;
    next += size_t(harmonics_.count()) * pair.components * pair.components;
  }
  tangents_.resize(next);
  find_entries(problem);
  find_groups();
  find_owners();
}

void WheelContact::find_entries(HarmonicProblem const& problem) {
  const int unit = int(problem.model().unit()), N = sectors_.sectors();
  std::vector<Entry> mine;
  for (size_t g = 0; g < numbers_.size(); ++g) {
    auto const& contact = problem.model().contacts()[g];
    const int d = contact.law->components(), in_sector = int(first_pair_[g + 1] - first_pair_[g]);
    PetscInt begin;
    check(MatGetOwnershipRange(contact.B, &begin, nullptr));
    for_entries(contact.B, [&](PetscInt row, PetscInt dof, double value) {
      const int number = numbers_[g][(row - begin) / d];
      mine.push_back({pairs_[first_pair_[g] + number % in_sector].first_row + int(row - begin) % d,
                      int(dof / unit - number / in_sector + N) % N, int(dof % unit), value / N});
    });
  }
  std::map<std::array<int, 3>, double> sum;
  for (Entry const& b : gathered(std::span<Entry const>(mine), comm_))
    sum[{b.row, b.ahead, b.dof}] += b.value;
  for (auto const& [at, value] : sum) entries_.push_back({at[0], at[1], at[2], value});
}

std::vector<double> WheelContact::stuck_stiffness(model::Model const& model) const {
  std::vector<double> k(rows_, 0.0);
  for (size_t g = 0; g < numbers_.size(); ++g) {
    const int in_sector = int(first_pair_[g + 1] - first_pair_[g]);
    for (size_t p = 0; p < numbers_[g].size(); ++p) {
      Pair const& pair = pairs_[first_pair_[g] + numbers_[g][p] % in_sector];
      for (int c = 0; c < pair.components; ++c)
        k[pair.first_row + c] +=
            model.contacts()[g].law->stuck_stiffness(c, int(p)) / double(sectors_.sectors());
    }
  }
  sum_over_ranks(k, comm_);
  return k;
}

void WheelContact::find_groups() {
  const int m = harmonics_.block_size();
  for (size_t p = 0; p < pairs_.size(); ++p) {
    if (groups_.empty() || (groups_.back().rows + pairs_[p].components) * m > most_together)
      groups_.push_back({p, p, pairs_[p].first_row, 0});
    ++groups_.back().end_pair;
    groups_.back().rows += pairs_[p].components;
  }
}

int WheelContact::largest_group() const {
  int rows = 0;
  for (Group const& group : groups_) rows = std::max(rows, group.rows);
  return rows * harmonics_.block_size();
}

void WheelContact::find_owners() {
  std::vector<PetscInt64> numbers(comm_size(comm_), 0);
  const auto size = [&](size_t pair) {
    const size_t ld = size_t(pairs_[pair].components) * harmonics_.block_size();
    return 2 + ld * ld;
  };
  for (size_t g = 0; g < numbers_.size(); ++g)
    for (size_t p = 0; p < numbers_[g].size(); ++p) {
      const int in_sector = int(first_pair_[g + 1] - first_pair_[g]), sector = numbers_[g][p] / in_sector;
      int owner = 0;
      while (sectors_.first_sector(owner + 1) <= sector) ++owner;
      outgoing_.push_back({owner, sector, first_pair_[g] + numbers_[g][p] % in_sector, g, p});
      numbers[owner] += PetscInt64(size(outgoing_.back().pair));
    }
  std::ranges::stable_sort(outgoing_, {}, &Outgoing::owner);
  for (size_t pair = 0; pair < pairs_.size(); ++pair) arriving_ += own_sectors_ * size(pair);

  PetscInt64 most = std::max(PetscInt64(arriving_), std::reduce(numbers.begin(), numbers.end()));
  MPI_Allreduce(MPI_IN_PLACE, &most, 1, MPIU_INT64, MPI_MAX, comm_);
  as_int(most + 2 * PetscInt64(numbers.size()), "numbers of a rank's contact pairs");
  sent_.assign(numbers.begin(), numbers.end());
}

void WheelContact::take(std::vector<PairTangents> const& contacts) {
  std::vector<double> out, in(arriving_);
  for (Outgoing const& pair : outgoing_) {
    const size_t ld = size_t(contacts[pair.contact].components) * harmonics_.block_size();
    double const* D = &contacts[pair.contact].D[pair.place * ld * ld];
    out.insert(out.end(), {double(pair.sector), double(pair.pair)});
    out.insert(out.end(), D, D + ld * ld);
  }
  exchange_(out, sent_, in);
  D_.resize(own_sectors_ * pairs_.size());
  for (size_t at = 0; at < in.size();) {
    const int sector = int(in[at]) - sectors_.first_sector(comm_rank(comm_)), pair = int(in[at + 1]);
    const size_t ld = size_t(pairs_[pair].components) * harmonics_.block_size();
    auto const from = in.begin() + at + 2;
    D_[sector * pairs_.size() + pair].assign(from, from + ld * ld);
    at += 2 + ld * ld;
  }
}

void WheelContact::average(bool symmetric) {
  std::ranges::fill(tangents_, 0);
  for (size_t k = 0; k < D_.size(); ++k) {
    Pair const& pair = pairs_[k % pairs_.size()];
    const int d = pair.components;
    const auto blocks = harmonic_tangents(harmonics_, d, D_[k].data(), false);
    for (int i = 0; i < harmonics_.count(); ++i)
      for (int r = 0; r < d; ++r)
        for (int c = 0; c < d; ++c) {
          const auto t = [&](int row, int col) {
            Rotation const& block = blocks[(i * d + row) * d + col];
            return harmonics_.orders()[i] == 0 ? complex(block.cc) : block.nearest();
          };
          tangents_[pair.first_tangent + (size_t(i) * d + r) * d + c] +=
              (symmetric ? (t(r, c) + t(c, r)) / 2.0 : t(r, c)) / double(sectors_.sectors());
        }
  }
  sum_over_ranks(tangents_, comm_);
}

/// dD of a group's pairs.
std::vector<double> WheelContact::rest(int sector, Group const& group) const {
  const size_t m = harmonics_.block_size(), size = group.rows * m;
  std::vector<double> dD(size * size, 0.0);
  for (size_t p = group.first_pair; p < group.end_pair; ++p) {
    const int d = pairs_[p].components;
    const size_t ld = d * m, at = (pairs_[p].first_row - group.first_row) * m;
    auto D = D_[sector * pairs_.size() + p];
    for (int i = 0; i < harmonics_.count(); ++i)
      for (int r = 0; r < d; ++r)
        for (int c = 0; c < d; ++c) {
          double* block = &D[(r * m + harmonics_.offset(i)) * ld + c * m + harmonics_.offset(i)];
          const Rotation t = Rotation::of(tangent(pairs_[p], i, r, c));
          block[0] -= t.cc;
          if (harmonics_.orders()[i]) block[1] -= t.cs, block[ld] -= t.sc, block[ld + 1] -= t.ss;
        }
    for (size_t r = 0; r < ld; ++r) std::copy_n(&D[r * ld], ld, &dD[(at + r) * size + at]);
  }
  return dD;
}

/// T += G dD
void WheelContact::add_compliance(std::vector<complex> const& G, Group const& group,
                                  std::vector<double> const& dD, std::vector<double>& T) const {
  const size_t m = harmonics_.block_size(), size = group.rows * m;
  for (size_t p = group.first_pair; p < group.end_pair; ++p) {
    const size_t first = pairs_[p].first_row - group.first_row, at = first * m, ld = pairs_[p].components * m;
    for (int r = 0; r < group.rows; ++r)
      for (int i = 0; i < harmonics_.count(); ++i)
        for (int k = 0; k < pairs_[p].components; ++k) {
          const complex g = G[(size_t(i) * rows_ + group.first_row + r) * rows_ + pairs_[p].first_row + k];
          double const* cosine = &dD[((first + k) * m + harmonics_.offset(i)) * size + at];
          double* out = &T[(r * m + harmonics_.offset(i)) * size + at];
          const bool mean = harmonics_.orders()[i] == 0;
          for (size_t c = 0; c < ld; ++c) out[c] += g.real() * cosine[c];
          for (size_t c = 0; c < ld && !mean; ++c) {
            out[c] += g.imag() * cosine[size + c];
            out[size + c] += g.real() * cosine[size + c] - g.imag() * cosine[c];
          }
        }
  }
}

void WheelContact::eliminate(std::vector<complex> const& G) {
  E_.clear();
  for (int j = 0; j < own_sectors_; ++j)
    for (Group const& group : groups_) {
      const int size = group.rows * harmonics_.block_size();
      auto E = rest(j, group);
      std::vector<double> T(E.size(), 0.0);
      for (int k = 0; k < size; ++k) T[size_t(k) * size + k] = 1;
      add_compliance(G, group, E, T);
      // column-major sight of row-major E T = dD is T^T E^T = dD^T
      if (lapack::solve(T, size, E, size))
        std::ranges::fill(E, 0.0);  // the waves' blocks alone serve this sector
      E_.emplace_back(E.begin(), E.end());
    }
}

std::vector<complex> WheelContact::apply(std::vector<complex> const& u, int columns) const {
  const int m = harmonics_.block_size(), H = harmonics_.count(), step = 1;
  const float one = 1, zero = 0;
  const size_t stride = size_t(own_sectors_) * H * rows_;
  std::vector<complex> f(u.size());
  std::vector<float> in, out;
  for (size_t k = 0; k < E_.size(); ++k) {
    Group const& group = groups_[k % groups_.size()];
    const int size = group.rows * m;
    in.assign(size_t(columns) * size, 0.0), out.resize(in.size());
    const auto for_entries = [&](auto visit) {
      for (int column = 0; column < columns; ++column)
        for (int r = 0; r < group.rows; ++r)
          for (int i = 0; i < H; ++i)
            visit(column * stride + ((k / groups_.size()) * H + i) * rows_ + group.first_row + r,
                  size_t(column) * size + r * m + harmonics_.offset(i), harmonics_.orders()[i] != 0);
    };
    for_entries([&](size_t at, size_t q, bool moves) {
      in[q] = float(u[at].real());
      if (moves) in[q + 1] = -float(u[at].imag());
    });
    if (columns == 1)
      sgemv_("T", &size, &size, &one, E_[k].data(), &size, in.data(), &step, &zero, out.data(), &step);
    else
      lapack::multiply("TN", {size, columns, size}, one, {E_[k].data(), size}, {in.data(), size}, zero,
                       out.data(), size);
    for_entries([&](size_t at, size_t q, bool moves) { f[at] = {out[q], moves ? -out[q + 1] : 0.0}; });
  }
  return f;
}

}  // namespace fretwave::wheel
