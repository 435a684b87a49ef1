#include "wheel/families.h"

#include <map>

#include "error.h"
#include "lapack.h"
#include "log.h"

namespace fretwave::wheel {

Families::Families(HarmonicProblem const& problem, MeanSector const& mean, std::vector<Member> members,
                   std::vector<complex> shapes)
    : problem_(problem),
      mean_(mean),
      first_sector_(int(problem.model().first_dof() / mean.dofs())),
      own_sectors_(int(problem.model().local_dofs() / mean.dofs())),
      members_(std::move(members)),
      deviation_(3) {
  for (int order = 0; order < 3; ++order) set_deviation(order, shapes);
}

complex Families::turn(int sector, size_t member) const {
  return mean_.turn(sector, members_[member].diameter);
}

/// N^-1 W^H (A - mean) W, W the members' motions of the whole wheel, one after the other. Members of one wave
/// keep what they share out: the mean is theirs already.
void Families::set_deviation(int order, std::vector<complex> const& shapes) {
  const MatHandle A = problem_.model().sum(order);
  if (!A) return;
  const size_t n = size_t(mean_.dofs());
  const int K = size();
  auto& P = deviation_[order];
  P.assign(size_t(K) * K, 0.0);
  for (int k = 0; k < K; ++k) {
    const auto forces = multiplied(A, k, &shapes[size_t(k) * n]);
    std::map<int, std::vector<complex>> in_waves;
    for (int l = 0; l < K; ++l) {
      if (members_[k].diameter == members_[l].diameter) continue;
      auto& wave = in_waves[members_[l].diameter];
      if (wave.empty()) wave = in_wave(forces, size_t(l));
      complex sum = 0;
      for (size_t i = 0; i < n; ++i) sum += std::conj(shapes[size_t(l) * n + i]) * wave[i];
      P[size_t(k) * K + l] = sum / double(mean_.sectors());
    }
  }
  sum_over_ranks(P, problem_.comm());
}

/// A x of a member's motion, by this rank's sectors and places. Collective.
std::vector<complex> Families::multiplied(Mat A, int member, complex const* shape) const {
  const size_t n = size_t(mean_.dofs());
  std::vector<complex> out(size_t(own_sectors_) * n);
  const VecHandle x = problem_.model().displacement(), y = like(x);
  const auto at = [&](int sector, size_t place) {
    return PetscInt(size_t(sector) * n + size_t(mean_.dof(int(place))));
  };
  for (const bool imaginary : {false, true}) {
    {
      WriteArray to(x);
      for (int j = 0; j < own_sectors_; ++j)
        for (size_t p = 0; p < n; ++p) {
          const complex a = turn(first_sector_ + j, size_t(member)) * shape[p];
          to[at(j, p)] = imaginary ? a.imag() : a.real();
        }
    }
    check(MatMult(A, x, y));
    const ReadArray from(y);
    for (int j = 0; j < own_sectors_; ++j)
      for (size_t p = 0; p < n; ++p)
        out[size_t(j) * n + p] += imaginary ? complex(0, from[at(j, p)]) : complex(from[at(j, p)]);
  }
  return out;
}

/// sum_j x_j e^{-2 pi i j d / N} over this rank's sectors, d of a member.
std::vector<complex> Families::in_wave(std::vector<complex> const& x, size_t member) const {
  const size_t n = size_t(mean_.dofs());
  std::vector<complex> out(n);
  for (int j = 0; j < own_sectors_; ++j) {
    const complex t = std::conj(turn(first_sector_ + j, member));
    for (size_t p = 0; p < n; ++p) out[p] += t * x[size_t(j) * n + p];
  }
  return out;
}

void Families::make(std::vector<complex> const& waves, std::vector<std::vector<complex>> const& coefficients,
                    std::vector<complex> const& Psi, std::vector<complex> const& Lambda,
                    WheelContact const& contact) {
  static const log::Event making("FwFamilies");
  const log::Span span(making);
  const int K = size();
  std::vector<double> S(size_t(4) * K * K, 0.0);
  if (contact.rows() > 0) add_contact(Psi, Lambda, contact, S);
  sum_over_ranks(S, problem_.comm());
  const auto add = [&](int row, int col, complex a) {
    double* at = &S[size_t(2 * col) * 2 * K + 2 * row];
    at[0] += a.real(), at[1] += a.imag(), at[2 * K] -= a.imag(), at[2 * K + 1] += a.real();
  };
  for (int col = 0; col < K; ++col)
    for (int row = 0; row < K; ++row) {
      complex a = waves[size_t(col) * K + row];
      for (int order = 0; order < 3; ++order)
        if (!deviation_[order].empty() && members_[row].harmonic == members_[col].harmonic)
          a += coefficients[members_[row].harmonic][order] * deviation_[order][size_t(col) * K + row];
      add(row, col, a);
    }
  if (lapack::invert(S, 2 * K))
    throw SingularBlock("the block of the families of modes of the wheel's preconditioner is singular");
  inverse_ = std::move(S);
}

/// N^-1 sum_j e^{-2 pi i j (d - d') / N} Lambda_d^H E_j Psi_d' of this rank's sectors.
void Families::add_contact(std::vector<complex> const& Psi, std::vector<complex> const& Lambda,
                           WheelContact const& contact, std::vector<double>& S) const {
  Harmonics const& h = problem_.harmonics();
  const int K = size(), R = contact.rows(), H = h.count();
  const size_t stride = size_t(own_sectors_) * H * R;
  std::vector<complex> u(stride * 2 * K);
  const auto at = [&](int j, int column, int member) {
    return column * stride + (size_t(j) * H + members_[member].harmonic) * R;
  };
  for (int k = 0; k < K; ++k)
    for (int part = 0; part < 2; ++part)
      for (int j = 0; j < own_sectors_; ++j) {
        const complex t =
            turn(first_sector_ + j, k) * (part ? complex(0, 1) : complex(1)) / double(mean_.sectors());
        for (int r = 0; r < R; ++r) u[at(j, 2 * k + part, k) + r] = t * Psi[size_t(k) * R + r];
      }
  const auto f = contact.apply(u, 2 * K);
  for (int column = 0; column < 2 * K; ++column)
    for (int k = 0; k < K; ++k) {
      complex sum = 0;
      for (int j = 0; j < own_sectors_; ++j) {
        complex of_sector = 0;
        for (int r = 0; r < R; ++r) of_sector += Lambda[size_t(k) * R + r] * f[at(j, column, k) + r];
        sum += std::conj(turn(first_sector_ + j, k)) * of_sector;
      }
      S[size_t(column) * 2 * K + 2 * k] += sum.real();
      S[size_t(column) * 2 * K + 2 * k + 1] += sum.imag();
    }
}

std::vector<complex> Families::solve(std::vector<complex> const& r) const {
  const int size = 2 * this->size(), step = 1;
  const double one = 1, zero = 0;
  std::vector<complex> out(r.size());
  dgemv_("N", &size, &size, &one, inverse_.data(), &size, reinterpret_cast<double const*>(r.data()), &step,
         &zero, reinterpret_cast<double*>(out.data()), &step);
  return out;
}

}  // namespace fretwave::wheel
