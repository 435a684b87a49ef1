#include "wheel/wave_modes.h"

#include <algorithm>
#include <cmath>

#include "error.h"
#include "fault.h"
#include "lapack.h"
#include "log.h"
#include "together.h"
#include "tuned.h"

namespace fretwave::wheel {

namespace {

using lapack::multiply;

const Tuned damped_together(
    "wheel_damped_together", 0.1,
    "damping between a wave's modes over their stiffness, up to which they serve as a basis");

}  // namespace

WaveModes::WaveModes(HarmonicProblem& problem, MeanSector const& mean, WheelContact& contact,
                     std::vector<Wave> const& waves)
    : problem_(problem),
      mean_(mean),
      contact_(contact),
      waves_(waves),
      n_(mean.dofs()),
      rows_(contact.rows()),
      stuck_(contact.stuck_stiffness(problem.model())),
      of_wave_(waves.size()) {
  for (size_t w = 0; w < waves_.size(); ++w) {
    const int d = std::min(waves_[w].diameter, mean_.sectors() - waves_[w].diameter);
    auto at = std::ranges::find(diameters_, d, &Diameter::d);
    if (at == diameters_.end()) at = diameters_.insert(at, Diameter{d, {}, {}});
    at->waves.push_back(w);
    diameter_of_.push_back(size_t(at - diameters_.begin()));
  }
}

std::unique_ptr<WaveModes> WaveModes::of(HarmonicProblem& problem, MeanSector const& mean,
                                         std::vector<Circulant<SparseBlock>> const& terms,
                                         WheelContact& contact, std::vector<Wave> const& waves,
                                         double highest) {
  static const log::Event making("FwWaveModes");
  const log::Span span(making);
  std::unique_ptr<WaveModes> out(new WaveModes(problem, mean, contact, waves));
  int fit = std::ranges::all_of(terms, [&](auto const& term) { return symmetric(term, mean.sectors()); }) &&
            std::ranges::all_of(out->stuck_, [](double k) { return std::isfinite(k); });
  for (const int order : {0, 2})
    fit = fit && std::ranges::any_of(problem.model().terms(), [&](auto& t) { return t.order == order; });
  if (!fit) return nullptr;
  WaveBases bases(problem.model(), mean, terms, contact, out->stuck_);
  std::vector<int> asked;
  for (Diameter const& of_d : out->diameters_) asked.push_back(of_d.d);
  bases.prepare(asked, problem.comm());
  for (Diameter& of_d : out->diameters_) {
    of_d.basis = bases.of_diameter(of_d.d);
    fit = fit && of_d.basis && highest * of_d.basis->damped_together <= damped_together;
  }
  MPI_Allreduce(MPI_IN_PLACE, &fit, 1, MPI_INT, MPI_LAND, problem.comm());
  return fit ? std::move(out) : nullptr;
}

/// Of stiffness, damping and inertia, over the stiffness that force rows are measured in.
std::vector<complex> WaveModes::coefficients(Exponents const& e, int harmonic) const {
  std::vector<complex> c(3);
  for (auto const& term : problem_.model().terms())
    c[term.order] = problem_.terms().stiffness().coefficients(term, e)[harmonic] / problem_.stiffness_scale();
  return c;
}

/// z, Z, G and X of a wave.
void WaveModes::set(Diameter const& of_d, size_t wave, Exponents const& e) {
  const int n = modes(of_d), R = rows_;
  WaveBasis const& basis = *of_d.basis;
  OfWave& of_wave = of_wave_[wave];
  auto &z = of_wave.z, &Z = of_wave.Z;
  const auto c = coefficients(e, waves_[wave].harmonic);
  of_wave.softness = basis.factor ? 1.0 / turned(wave, c[0]) : 0.0;
  z.resize(n), Z.resize(n);
  for (int l = 0; l < n; ++l) {
    z[l] = turned(wave, c[0]) + turned(wave, c[1]) * basis.damping[l] + turned(wave, c[2]) * basis.theta[l];
    Z[l] = 1.0 / z[l] - of_wave.softness;
  }
  if (apart_)
    for (const int l : of_wave.family) Z[l] = -of_wave.softness;
  std::vector<complex> PhiZ(basis.Phi), G(basis.static_compliance), X(size_t(R) * R), A(X), GX(X), XG(X);
  for (int l = 0; l < n; ++l)
    for (int r = 0; r < R; ++r) PhiZ[size_t(l) * R + r] *= Z[l];
  G.resize(size_t(R) * R);
  multiply("NC", {R, R, n}, 1.0, {PhiZ.data(), R}, {basis.Phi.data(), R}, of_wave.softness, G.data(), R);
  contact_.for_tangents(waves_[wave].harmonic, [&](int r, int c, complex t) {
    X[size_t(c) * R + r] += turned(wave, t) - (r == c ? stuck_[r] / problem_.stiffness_scale() : 0.0);
  });
  multiply("NN", {R, R, R}, 1.0, {X.data(), R}, {G.data(), R}, 0.0, A.data(), R);
  for (int r = 0; r < R; ++r) A[size_t(r) * R + r] += 1;
  fault::point("wave block");
  const bool regular = std::ranges::all_of(Z, [](complex a) { return std::isfinite(std::abs(a)); });
  if (!regular || (R > 0 && lapack::solve(A, R, X, R)) || fault::value("wave block"))
    throw SingularBlock("the block of nodal diameter " + std::to_string(waves_[wave].diameter) +
                        " of the wheel's preconditioner is singular: a free motion at this harmonic");
  multiply("NN", {R, R, R}, -1.0, {G.data(), R}, {X.data(), R}, 0.0, GX.data(), R);
  multiply("NN", {R, R, R}, -1.0, {X.data(), R}, {G.data(), R}, 0.0, XG.data(), R);
  A = G;
  multiply("NN", {R, R, R}, 1.0, {GX.data(), R}, {G.data(), R}, 1.0, A.data(), R);
  for (int r = 0; r < R; ++r) GX[size_t(r) * R + r] += 1, XG[size_t(r) * R + r] += 1;
  of_wave.X.assign(X.begin(), X.end());
  of_wave.motion.assign(GX.begin(), GX.end()), of_wave.force.assign(XG.begin(), XG.end());
  complex* out = &compliances_[wave * R * R];
  for (int r = 0; r < R; ++r)
    for (int c = 0; c < R; ++c) out[size_t(r) * R + c] = turned(wave, A[size_t(c) * R + r]);
}

void WaveModes::make(Point const& point) {
  static const log::Event making("FwWaveBlocks");
  const log::Span span(making);
  const int first = problem_.harmonics().fundamental(), N = mean_.sectors();
  beside_ = beside(point.exponents, first);
  contact_.average(true);
  compliances_.resize(waves_.size() * rows_ * rows_);
  apart_ = !point.travelling;
  if (apart_) find_family(point.exponents);
  together(problem_.comm(), "making the waves' blocks", [&] {
    for (Diameter const& of_d : diameters_)
      for (const size_t w : of_d.waves) {
        const bool moves =
            waves_[w].harmonic == first && (point.moving[of_d.d] || point.moving[(N - of_d.d) % N]);
        set(of_d, w, moves ? beside_ : point.exponents);
      }
  });
}

/// 8 m R^2 for G of a wave of m modes, 8 R^3 each for three products and 8/3 more and 8 for X.
double WaveModes::flops() const {
  const double R = rows_;
  double sum = 0;
  for (Diameter const& of_d : diameters_)
    sum += double(of_d.waves.size()) * (8 * modes(of_d) * R * R + 35 * R * R * R);
  return sum;
}

/// 16 n m of a wave for U, and where it has a factor 8 n R for static shapes and two solves.
double WaveModes::applied_flops() const {
  const double n = n_, R = rows_;
  double sum = 0;
  for (Diameter const& of_d : diameters_) {
    const double still = of_d.basis->factor ? 8 * n * R + 16 * of_d.basis->factor->entries() : 0;
    sum += double(of_d.waves.size()) * (16 * n * modes(of_d) + still);
  }
  return sum;
}

double WaveModes::megabytes() const {
  const double n = n_, R = rows_;
  double sum =
      diameters_.empty() || !diameters_[0].basis->factor ? 0 : diameters_[0].basis->factor->megabytes();
  for (Diameter const& of_d : diameters_) {
    const double m = modes(of_d), still = of_d.basis->factor ? n * R : 0;
    sum += ((m + still / n) * n * sizeof(scomplex) + m * R * sizeof(complex) +
            double(of_d.waves.size()) * (m + 3 * R * R) * sizeof(complex)) /
           1e6;
  }
  return sum;
}

std::string WaveModes::describe() const {
  const bool all = diameters_.empty() || !diameters_[0].basis->factor;
  return all ? "modes" : "lowest modes and a sector's factor";
}

}  // namespace fretwave::wheel
