#include "hb/harmonic_problem.h"

#include <algorithm>

#include "error.h"
#include "text.h"

namespace fretwave::hb {

namespace {

/// PETSc counts unknowns in PetscInt.
model::Model const& countable(model::Model const& model, Harmonics const& h) {
  const double unknowns = double(model.dofs()) * h.block_size() + 10;
  if (unknowns > double(PETSC_MAX_INT))
    throw InputError("the harmonic balance has more unknowns than this build of PETSc can count",
                     std::to_string(PetscInt64(unknowns)), "at most " + std::to_string(PETSC_MAX_INT),
                     "reduce the model, retain fewer harmonics, or build PETSc with 64-bit indices");
  return model;
}

}  // namespace

std::string gap_text(double distance) { return "gaps " + short_text(distance) + " m wider"; }

HarmonicProblem::HarmonicProblem(model::Model const& model, Harmonics const& h, int scalars, Row row,
                                 double reference_stiffness)
    : residual_(countable(model, h), h),
      scalars_(scalars),
      row_(std::move(row)),
      local_block_(model.local_dofs() * h.block_size()),
      stiffness_(reference_stiffness) {
  if (row_.empty())
    throw InputError("the row to be normalised or observed is zero", "no entry", "one at least",
                     "give a row");
  for (auto const& [dof, weight] : row_)
    if (dof < 0 || dof >= model.dofs())
      throw InputError("the chosen dof does not exist", std::to_string(dof),
                       "0 to " + std::to_string(model.dofs() - 1), "choose a dof of the model");
  q_ = residual_.vector();
  for (auto* v : {&Q_, &dQ_, &R_, &dR_, &excitation_, &static_, &static_load_}) *v = like(q_);
  check(VecSet(excitation_, 0));
  check(VecSet(static_, 0));
  check(VecSet(static_load_, 0));
  last_ = unknowns();
}

HarmonicProblem::HarmonicProblem(HarmonicProblem const& same, Harmonics const& h)
    : HarmonicProblem(same.model(), h, same.scalars_, same.row_, same.stiffness_) {
  excitation_ = same.on(*this, same.excitation_);
  static_ = same.on(*this, same.static_), static_load_ = same.on(*this, same.static_load_);
  for (auto const& g : same.unfold_) unfold_.push_back(same.on(*this, g));
  sliders_ = same.sliders_, owner_ = same.owner_;
  last_ = unknowns();
}

VecHandle HarmonicProblem::on(HarmonicProblem const& other, Vec x) const {
  const PetscInt tail = local_size(x) - local_block_;
  VecHandle out = make_vector(comm(), other.local_block_ + tail);
  const ReadArray from(x);
  const WriteArray to(out);
  embed(harmonics(), from.data(), other.harmonics(), to.data(), int(model().local_dofs()));
  std::copy_n(from.data() + local_block_, tail, to.data() + other.local_block_);
  return out;
}

std::span<std::pair<PetscInt, double> const> HarmonicProblem::mine() const {
  const PetscInt first = model().first_dof(), end = first + model().local_dofs();
  const auto before = [](auto const& entry, PetscInt dof) { return entry.first < dof; };
  return {std::lower_bound(row_.begin(), row_.end(), first, before),
          std::lower_bound(row_.begin(), row_.end(), end, before)};
}

std::vector<double> HarmonicProblem::scalars(Vec y) {
  std::vector<double> z(scalars_ + 2 + unfoldings(), 0.0);
  ReadArray in(y);
  if (last_rank()) {
    std::copy_n(in.data() + local_block_, unfoldings(), z.begin() + scalars_ + 2);
    std::copy_n(in.data() + local_block_ + unfoldings(), scalars_, z.begin());
  }
  if (harmonics().fundamental() >= 0 && !mine().empty()) {
    double* along = z.data() + scalars_;
    along[0] = along[1] = -0.0;  // to which adding x gives x
    for (auto const& [dof, weight] : mine()) {
      const PetscInt place = (dof - model().first_dof()) * harmonics().block_size() +
                             harmonics().offset(harmonics().fundamental());
      for (int j = 0; j < 2; ++j) along[j] += weight * in[place + j];
    }
  }
  MPI_Allreduce(MPI_IN_PLACE, z.data(), int(z.size()), MPI_DOUBLE, MPI_SUM, comm());
  return z;
}

void HarmonicProblem::unpack(Vec y) {
  z_ = scalars(y);
  motion_ = motion(z_);
  residual_.stand_off(motion_.stand_off);
  if (sliders_) residual_.place(*sliders_, owner_);
  {
    ReadArray in(y);
    std::copy_n(in.data(), local_block_, WriteArray(q_).data());
  }
  check(VecWAXPY(Q_, motion_.amplitude, q_, static_));
}

void HarmonicProblem::set_mean(Vec per_dof, Vec blocks) {
  ReadArray in(per_dof);
  WriteArray out(blocks);
  for (PetscInt i = 0; i < model().local_dofs(); ++i) out[i * harmonics().block_size()] = in[i];
}

void HarmonicProblem::preload(Vec x, Vec P) {
  if (harmonics().orders()[0] != 0)
    throw InputError("a preloaded structure moves about a mean that is not retained",
                     "lowest harmonic " + std::to_string(harmonics().orders()[0]), "harmonic 0 retained",
                     "retain all harmonics");
  set_mean(x, static_);
  set_mean(P, static_load_);
  linearised_ = false;
}

void HarmonicProblem::stand(PerContact sliders) {
  static unsigned owners = 0;
  sliders_ = std::move(sliders), owner_ = ++owners;
  residual_.place(*sliders_, owner_);
  linearised_ = false;
}

void HarmonicProblem::keep_loads(HarmonicProblem const& other) {
  sliders_ = other.sliders_, owner_ = other.owner_;
  check(VecCopy(other.static_, static_));
  check(VecWAXPY(static_load_, 1, other.excitation_, other.static_load_));
  linearised_ = false;
}

void HarmonicProblem::residual(Vec y, Vec r) {
  unpack(y);
  residual_.evaluate(Q_, motion_.exponents, R_);
  check(VecAXPBYPCZ(R_, -motion_.load, -1, 1, excitation_, static_load_));
  check(VecScale(R_, 1 / (stiffness_ * motion_.amplitude)));
  check(VecCopy(y, last_));
  columns_ = std::vector<VecHandle>(scalars_);
  linearised_ = true, contact_version_ = residual_.contact_version();
  put_residual(r);
}

VecHandle HarmonicProblem::residual_at(Vec y) {
  linearise(y);
  VecHandle r = equations();
  put_residual(r);
  return r;
}

void HarmonicProblem::put_residual(Vec r) {
  const auto along = components(q_);
  WriteArray out(r);
  ReadArray in(R_);
  std::copy_n(in.data(), local_block_, out.data());
  border(z_, along, out.data());
  if (last_rank() && normalised()) out[local_block_] -= 1;
}

void HarmonicProblem::unfold(Vec re, Vec im) {
  const MatHandle M = model().sum(2);
  const PetscInt m = harmonics().block_size(), cosine = harmonics().offset(harmonics().fundamental());
  VecHandle Mre = like(re), Mim = like(im);
  check(MatMult(M, re, Mre));
  check(MatMult(M, im, Mim));
  // (tau_c - i tau_s) M phi as (cos, sin); with the same vectors, Re and -Im of phi^H M q_1, which is (cos,
  // sin)
  const ReadArray a(Mre), b(Mim);
  unfold_.clear();
  for (int part = 0; part < 2; ++part) {
    VecHandle g = like(q_);
    {
      WriteArray out(g);
      for (PetscInt i = 0; i < model().local_dofs(); ++i) {
        out[i * m + cosine] = part ? b[i] : a[i];
        out[i * m + cosine + 1] = part ? a[i] : -b[i];
      }
    }
    double length;
    check(VecNormalize(g, &length));
    if (!(length > 0))
      throw InputError("the mode to be avoided has no inertia", std::to_string(length), "> 0",
                       "give the other mode of the pair");
    unfold_.push_back(std::move(g));
  }
  last_ = unknowns();
  linearised_ = false;
}

std::vector<double> HarmonicProblem::unfolding(Vec y) {
  const auto z = scalars(y);
  return {z.begin() + scalars_ + 2, z.end()};
}

/// Of q along the unfolding's vectors.
std::vector<double> HarmonicProblem::components(Vec q) const {
  std::vector<double> along;
  for (auto const& g : unfold_) {
    along.push_back(0);
    check(VecDot(g, q, &along.back()));
  }
  return along;
}

/// Adds the unfolding's force and sets the rows beside the harmonic ones, all of them linear: (w . q, along).
void HarmonicProblem::border(std::vector<double> const& z, std::vector<double> const& along,
                             double* r) const {
  for (int j = 0; j < unfoldings(); ++j) {
    const ReadArray g(unfold_[j]);
    for (PetscInt i = 0; i < local_block_; ++i) r[i] += z[scalars_ + 2 + j] * g[i];
  }
  if (!last_rank() || !normalised()) return;
  std::copy_n(z.begin() + scalars_, 2, r + local_block_);
  std::copy(along.begin(), along.end(), r + local_block_ + 2);
}

double HarmonicProblem::rounding(Vec y) {
  linearise(y);
  return residual_.rounding() / (stiffness_ * motion_.amplitude);
}

std::uint64_t HarmonicProblem::piece(Vec y) {
  linearise(y);
  return residual_.piece();
}

bool HarmonicProblem::measure_in(double k) {
  const bool changes = k != stiffness_;
  stiffness_ = k;
  if (changes) linearised_ = false;
  return changes;
}

void HarmonicProblem::wear(PerContact const& depth) {
  residual_.wear(depth);
  linearised_ = false;
}

EnergyBalance HarmonicProblem::energy(Vec y) {
  linearise(y);
  return residual_.energy();
}

/// Motion counts relative to its own size, so that a step is a share of it whatever the mesh. The mean of a
/// vibration does not count: what little holds a part in place by friction (a ring in its groove) lets it
/// drift far and turn back wherever a sample changes between stick and slip, while the branch itself goes on.
void HarmonicProblem::metric(Vec y, Vec weights) {
  const PetscInt m = harmonics().block_size();
  const PetscInt mean = harmonics().orders()[0] == 0 && m > 1 ? 1 : 0;
  ReadArray in(y);
  double square = 0;
  for (PetscInt i = 0; i < local_block_; ++i)
    if (i % m >= mean) square += in[i] * in[i];
  MPI_Allreduce(MPI_IN_PLACE, &square, 1, MPI_DOUBLE, MPI_SUM, comm());
  WriteArray out(weights);
  const double weight = square > 0 ? 1 / square : 1;  // no motion at all: the scalars alone measure
  for (PetscInt i = 0; i < local_block_; ++i) out[i] = i % m < mean ? 0 : weight;
  if (!last_rank()) return;
  std::fill_n(out.data() + local_block_, unfoldings(), 1.0);
  for (int j = 0; j < scalars_; ++j) out[local_block_ + unfoldings() + j] = metric_weight(j);
}

VecHandle HarmonicProblem::pack(Vec q, std::vector<double> const& z) const {
  VecHandle y = unknowns();
  WriteArray out(y);
  ReadArray in(q);
  std::copy_n(in.data(), local_block_, out.data());
  if (!last_rank()) return y;
  std::fill_n(out.data() + local_block_, unfoldings(), 0.0);
  std::copy_n(z.begin(), scalars_, out.data() + local_block_ + unfoldings());
  return y;
}

VecHandle HarmonicProblem::coefficients(Vec y) {
  if (sliders_) residual_.place(*sliders_, owner_);  // whoever asks for the motion asks the laws next
  VecHandle Q = residual_.vector();
  const auto m = motion(scalars(y));
  ReadArray in(y), rest(static_);
  WriteArray out(Q);
  for (PetscInt i = 0; i < local_block_; ++i) out[i] = rest[i] + m.amplitude * in[i];
  return Q;
}

ContactSummary HarmonicProblem::summarise(Vec y) {
  return residual_.summarise(coefficients(y), exponents(y));
}

std::vector<ContactPeriod> HarmonicProblem::contact_periods(Vec y) {
  return residual_.periods(coefficients(y), exponents(y));
}

}  // namespace fretwave::hb
