#include "hb/harmonic_problem.h"

#include <algorithm>
#include <type_traits>

#include "error.h"
#include "hb/checked_pc.h"
#include "hb/condensed_pc.h"
#include "hb/harmonic_pc.h"
#include "hb/wheel_pc.h"
#include "text.h"

namespace fretwave::hb {

namespace {

/// y += f x for exponents.
void add(Exponents& y, double f, Exponents const& x) {
  for (size_t i = 0; i < y.s.size(); ++i) y.s[i] += f * x.s[i];
  y.inertia_damping += f * x.inertia_damping;
}

/// Dense blocks are for reduced models. They are inverted in single precision, which the element stiffness of
/// a fine mesh, 1e8 times that of its first mode, outdoes; and 3000 dofs take 144 MB a harmonic.
bool suits_dense(model::Model const& model) {
  constexpr double always = 200, largest = 3000, share = 0.25;  // dofs, dofs, of nonzero entries
  const double n = double(model.dofs());
  double entries = 0;
  for (auto const& term : model.terms()) {
    MatInfo info;
    check(MatGetInfo(term.A, MAT_GLOBAL_SUM, &info));
    entries = std::max(entries, info.nz_used);
  }
  return n <= always || (n <= largest && entries > share * n * n);
}

[[noreturn]] void refuse(std::string const& blocks, std::string const& problem) {
  throw InputError("option blocks: there are no " + blocks + " blocks for " + problem, blocks, "auto",
                   "leave out the option -<analysis>_blocks");
}

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
  linearised_ = true, contact_version_ = residual_.contact_version();
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

/// Line searches evaluate elsewhere: the point of linearisation is y, whatever was evaluated last, and the
/// laws are as they are now, whichever problem of the model has changed them.
void HarmonicProblem::linearise(Vec y) {
  PetscBool same = PETSC_FALSE;
  if (linearised_ && contact_version_ == residual_.contact_version()) check(VecEqual(y, last_, &same));
  if (same) return;
  VecHandle unused = equations();
  residual(y, unused);
}

// Q = Q_static + a q: dQ = a (dq + q dlog a); r = R / (k a): dr = dR / (k a) - r dlog a
void HarmonicProblem::product(Vec y, Vec dy, Vec dr) {
  linearise(y);
  const auto dz = scalars(dy);
  Exponents de{std::vector<complex>(harmonics().count()), 0};
  double dlog = 0, load = 0;
  for (int j = 0; j < scalars_; ++j) {
    add(de, dz[j], motion_.dexponents[j]);
    dlog += dz[j] * motion_.dlog_amplitude[j];
    load += dz[j] * dload(j);
  }
  {
    ReadArray in(dy);
    std::copy_n(in.data(), local_block_, WriteArray(dQ_).data());
  }
  const auto along = components(dQ_);
  check(VecAXPBY(dQ_, motion_.amplitude * dlog, motion_.amplitude, q_));
  residual_.product(dQ_, &de, dR_);
  check(VecAXPY(dR_, -load, excitation_));
  add_stand_off(scalars_ - 1, dz[scalars_ - 1], dR_);
  check(VecAXPBY(dR_, -dlog, 1 / (stiffness_ * motion_.amplitude), R_));
  WriteArray out(dr);
  ReadArray in(dR_);
  std::copy_n(in.data(), local_block_, out.data());
  border(dz, along, out.data());
}

void HarmonicProblem::pattern(std::vector<PetscInt>& rows, std::vector<PetscInt>& cols) {
  residual_.pattern(rows, cols);
  const PetscInt first = model().first_dof() * harmonics().block_size(),
                 all = model().dofs() * harmonics().block_size();
  for (int j = 0; j < unfoldings() + scalars_; ++j)
    for (PetscInt i = 0; i < local_block_; ++i) rows.push_back(first + i), cols.push_back(all + j);
  for (int j = 0; j < unfoldings(); ++j)
    for (PetscInt i = 0; i < local_block_; ++i) rows.push_back(all + 2 + j), cols.push_back(first + i);
  if (!normalised()) return;
  for (int j = 0; j < 2; ++j)
    for (auto const& [dof, weight] : mine())
      rows.push_back(all + j),
          cols.push_back(dof * harmonics().block_size() + harmonics().offset(harmonics().fundamental()) + j);
}

/// dR += dR/d(stand-off) d(stand-off)/dz_j dz.
void HarmonicProblem::add_stand_off(int j, double dz, Vec dR) {
  if (j != scalars_ - 1 || motion_.dstand_off == 0) return;
  VecHandle wider = like(dR);
  residual_.stand_off_product(wider);
  check(VecAXPY(dR, dz * motion_.dstand_off, wider));
}

void HarmonicProblem::column(int j, double* v) {
  const double dlog = motion_.dlog_amplitude[j];
  check(VecCopy(q_, dQ_));
  check(VecScale(dQ_, dlog * motion_.amplitude));
  residual_.product(dlog ? Vec(dQ_) : nullptr, &motion_.dexponents[j], dR_);
  check(VecAXPY(dR_, -dload(j), excitation_));
  add_stand_off(j, 1, dR_);
  check(VecAXPBY(dR_, -dlog, 1 / (stiffness_ * motion_.amplitude), R_));
  ReadArray in(dR_);
  std::copy_n(in.data(), local_block_, v);
}

void HarmonicProblem::values(Vec y, std::span<double> v) {
  linearise(y);
  double* next = residual_.values(1 / stiffness_, v.data());
  for (auto const& g : unfold_) next = std::copy_n(ReadArray(g).data(), local_block_, next);
  for (int j = 0; j < scalars_; ++j, next += local_block_) column(j, next);
  for (auto const& g : unfold_) next = std::copy_n(ReadArray(g).data(), local_block_, next);
  for (int j = 0; normalised() && j < 2; ++j)
    for (auto const& [dof, weight] : mine()) *next++ = weight;
}

VecHandle HarmonicProblem::scalar_column(Vec y, int j) {
  linearise(y);
  VecHandle out = like(q_);
  column(j, WriteArray(out).data());
  return out;
}

std::vector<PairTangents> HarmonicProblem::pair_tangents(Vec y) {
  linearise(y);
  return residual_.pair_tangents();
}

void HarmonicProblem::wear(PerContact const& depth) {
  residual_.wear(depth);
  linearised_ = false;
}

VecHandle HarmonicProblem::gap_product(Vec y, PerContact const& dgap) {
  linearise(y);
  residual_.gap_product(dgap, dR_);
  VecHandle out = equations();
  check(VecSet(out, 0));
  ReadArray in(dR_);
  const double scale = 1 / (stiffness_ * motion_.amplitude);
  std::transform(in.data(), in.data() + local_block_, WriteArray(out).data(),
                 [&](double r) { return scale * r; });
  return out;
}

EnergyBalance HarmonicProblem::energy(Vec y) {
  linearise(y);
  return residual_.energy();
}

/// A pair that reaches into another sector couples harmonics with phases, which the condensed form leaves
/// out.
bool HarmonicProblem::condensable() const {
  auto const& contacts = model().contacts();
  return !model().unit() && !unfoldings() &&
         std::all_of(contacts.begin(), contacts.end(),
                     [](auto const& contact) { return contact.ahead.empty(); });
}

/// `blocks` other than auto is taken or refused. A wheel is dealt with by its waves, unless the contact is
/// not the same in all sectors.
std::unique_ptr<solve::Preconditioner> HarmonicProblem::preconditioner(std::string const& blocks) {
  condensed_ = false;
  const bool waves = model().unit() && WheelPreconditioner::suits(*this), free = blocks == "auto";
  const auto make = [&]<class P>(std::type_identity<P>, std::string note = "") {
    return std::make_unique<CheckedPreconditioner>(std::make_unique<P>(*this), std::move(note));
  };
  if (harmonics().fundamental() < 0 || (unfoldings() && !waves)) {
    if (!free) refuse(blocks, unfoldings() ? "a wheel whose double mode is unfolded" : "a static problem");
    return nullptr;
  }
  if (waves && free) return make(std::type_identity<WheelPreconditioner>());
  if (unfoldings()) refuse(blocks, "a wheel whose double mode is unfolded");
  const bool phased = std::any_of(model().contacts().begin(), model().contacts().end(),
                                  [](auto const& contact) { return !contact.ahead.empty(); });
  if (phased && blocks == "sparse") refuse(blocks, "a contact that reaches the next sector");
  const std::string note = model().unit() && !waves ? " (contact not the same in all sectors: no waves)" : "";
  condensed_ = !phased && (blocks == "sparse" || (free && !suits_dense(model())));
  if (condensed_) return make(std::type_identity<CondensedPreconditioner>(), note);
  return make(std::type_identity<HarmonicPreconditioner>(), note);
}

std::unique_ptr<solve::Preconditioner> HarmonicProblem::fallback(double& bytes) {
  if (condensed_ || !condensable() || harmonics().fundamental() < 0) return nullptr;
  double rows = 0;
  for (auto const& contact : model().contacts()) rows += contact.law->components() * contact.law->pairs();
  MPI_Allreduce(MPI_IN_PLACE, &rows, 1, MPI_DOUBLE, MPI_SUM, comm());
  const double size = rows * harmonics().block_size() + scalars_;
  bytes = 8 * size * size;
  return std::make_unique<CheckedPreconditioner>(std::make_unique<CondensedPreconditioner>(*this));
}

/// A step in the mean alone: friction held it, and what held it slips now.
std::string HarmonicProblem::explain(Vec, Vec dy) {
  const PetscInt m = harmonics().block_size();
  double sums[2] = {};  // of the mean, of all
  {
    ReadArray in(dy);
    for (PetscInt i = 0; i < local_block_; ++i) {
      sums[1] += in[i] * in[i];
      if (i % m == 0 && harmonics().orders()[0] == 0) sums[0] += in[i] * in[i];
    }
  }
  MPI_Allreduce(MPI_IN_PLACE, sums, 2, MPI_DOUBLE, MPI_SUM, comm());
  if (sums[0] < 0.9 * sums[1]) return {};
  return "the mean position is free: every pair that held it slips or opens within a period";
}

double HarmonicProblem::jacobian_entries() const {
  const double m = harmonics().block_size();
  double entries = 0, contact = 0;
  for (auto const& term : model().terms()) {
    MatInfo info;
    check(MatGetInfo(term.A, MAT_GLOBAL_SUM, &info));
    entries += info.nz_used * 2 * m;
  }
  for (auto const& group : model().contacts()) {
    MatInfo info;
    PetscInt rows;
    check(MatGetSize(group.B, &rows, nullptr));
    check(MatGetInfo(group.B, MAT_GLOBAL_SUM, &info));
    if (!rows) continue;
    const double of_a_pair = info.nz_used / double(rows) * group.law->components();
    contact += double(rows) / group.law->components() * of_a_pair * of_a_pair * m * m;
  }
  return entries + contact;
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
