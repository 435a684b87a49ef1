#include "wheel/wheel_pc.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>

#include "log.h"
#include "precondition/kinds.h"
#include "solve/memory.h"
#include "tuned.h"
#include "wheel/wave_inverses.h"
#include "wheel/wave_modes.h"

namespace fretwave::wheel {

namespace {

const Tuned pure("wheel_pure", 0.999, "share of the largest wave in a travelling one");
const Tuned faint("wheel_faint", 1e-6, "share of a wave in the motion that counts as none");

}  // namespace

/// Every sector has the same pairs on the same of its dofs: those of a rank are numbered sector by sector.
bool WheelPreconditioner::suits(HarmonicProblem const& problem) {
  model::Model const& model = problem.model();
  const PetscInt unit = model.unit(), sectors = model.dofs() / unit;
  int repeats = model.dofs() % unit == 0;
  for (auto const& contact : model.contacts()) {
    PetscInt64 pairs = contact.law->pairs();
    MPI_Allreduce(MPI_IN_PLACE, &pairs, 1, MPIU_INT64, MPI_SUM, model.comm());
    if (pairs % sectors != 0 || !contact.ahead.empty()) return false;
    const int d = contact.law->components(), in_sector = int(pairs / sectors);
    // (pair in its sector, component, sectors ahead, dof) -> how many of this rank's pairs have it
    std::map<std::array<PetscInt, 4>, int> places;
    PetscInt begin;
    check(MatGetOwnershipRange(contact.B, &begin, nullptr));
    for_entries(contact.B, [&](PetscInt row, PetscInt dof, double) {
      const int number = contact.numbers[(row - begin) / d];
      const PetscInt ahead = (dof / unit - number / in_sector + sectors) % sectors;
      ++places[{number % in_sector, (row - begin) % d, ahead, dof % unit}];
    });
    std::vector<int> mine(in_sector, 0);
    for (int number : contact.numbers) ++mine[number % in_sector];
    for (auto const& [place, count] : places) repeats = repeats && count == mine[size_t(place[0])];
  }
  MPI_Allreduce(MPI_IN_PLACE, &repeats, 1, MPI_INT, MPI_LAND, model.comm());
  return repeats;
}

WheelPreconditioner::WheelPreconditioner(HarmonicProblem& problem)
    : problem_(problem),
      unit_(int(problem.model().unit())),
      sectors_(int(problem.model().dofs() / problem.model().unit())),
      m_(problem.harmonics().block_size()),
      harmonics_(problem.harmonics().count()),
      local_sectors_(int(problem.model().local_dofs() / problem.model().unit())),
      dofs_(local_sectors_, harmonics_, unit_, problem.comm()),
      contact_(problem, dofs_),
      mean_(problem.model(), contact_),
      rows_(local_sectors_, harmonics_, contact_.rows(), problem.comm()) {}

/// By the waves' modes where they have some, else by inverses. Collective.
void WheelPreconditioner::choose_blocks(Exponents const& e) {
  double highest = 0;
  for (complex const& s : e.s) highest = std::max(highest, std::abs(s));
  auto terms = mean_.terms(problem_.model());
  blocks_ = WaveModes::of(problem_, mean_, terms, contact_, dofs_.waves(), highest);
  if (blocks_) return;
  const double bytes = sizeof(scomplex) * double(unit_) * unit_ * sectors_ * harmonics_;
  const auto why = solve::beyond_memory("the inverses of the waves' blocks", bytes, problem_.comm());
  if (!why.empty())
    throw InputError(
        "the waves of a wheel have no modes that serve (unsymmetric terms, a free motion with all "
        "pairs stuck, springs without an end, or damping between modes), and " +
            why,
        std::to_string(unit_) + " dofs a sector", "sectors whose blocks fit",
        "reduce the sector, or hold what is free");
  blocks_ = std::make_unique<WaveInverses>(problem_, mean_, std::move(terms), contact_, dofs_.waves());
}

/// This rank's harmonic blocks as sectors x harmonics x places, q = qc - i qs.
std::vector<complex> WheelPreconditioner::gather(double const* x) const {
  Harmonics const& h = problem_.harmonics();
  std::vector<complex> out(size_t(local_sectors_) * harmonics_ * unit_);
  for (int j = 0; j < local_sectors_; ++j)
    for (int k = 0; k < unit_; ++k) {
      double const* block = x + (size_t(j) * unit_ + mean_.dof(k)) * m_;
      for (int i = 0; i < harmonics_; ++i) {
        double const* q = block + h.offset(i);
        out[(size_t(j) * harmonics_ + i) * unit_ + k] = {q[0], h.orders()[i] ? -q[1] : 0.0};
      }
    }
  return out;
}

/// Shares of the fundamental's energy in the waves d. Collective.
std::vector<double> WheelPreconditioner::spectrum(Vec y) const {
  const auto waves = dofs_.to_waves(gather(ReadArray(y).data()));
  std::vector<double> shares(sectors_, 0.0);
  for (size_t w = 0; w < dofs_.waves().size(); ++w)
    if (dofs_.waves()[w].harmonic == problem_.harmonics().fundamental())
      for (int i = 0; i < unit_; ++i) shares[dofs_.waves()[w].diameter] += std::norm(waves[w * unit_ + i]);
  MPI_Allreduce(MPI_IN_PLACE, shares.data(), sectors_, MPI_DOUBLE, MPI_SUM, problem_.comm());
  double sum = 0, left = 0;
  for (double s : shares) sum += s;
  const double none = faint * sum;
  for (double& s : shares) left += s = sum == 0 ? 1.0 / sectors_ : s > none ? s : 0;
  for (double& s : shares) s /= left;
  return shares;
}

/// The compliance of a sector's rows where no other is forced: the mean over the waves; harmonics x rows x
/// rows. Collective.
std::vector<complex> WheelPreconditioner::of_one_sector() const {
  const size_t square = size_t(contact_.rows()) * contact_.rows();
  std::vector<complex> G(harmonics_ * square);
  for (size_t w = 0; w < dofs_.waves().size(); ++w)
    for (size_t k = 0; k < square; ++k)
      G[dofs_.waves()[w].harmonic * square + k] += blocks_->compliances()[w * square + k] / double(sectors_);
  sum_over_ranks(G, problem_.comm());
  return G;
}

/// What the waves' blocks leave of the contact. Collective.
void WheelPreconditioner::eliminate(bool travelling, int wave) {
  static const log::Event elimination("FwElimination");
  const log::Span span(elimination);
  if (!travelling)
    eliminate_by_sector();
  else if (contact_.rows() > 0)
    eliminate_in_waves(wave);
}

/// The contact about a travelling wave. Collective.
void WheelPreconditioner::eliminate_in_waves(int wave) {
  if (!travelling_ || travelling_->wave() != wave)
    travelling_.emplace(contact_, problem_.harmonics(), local_sectors_, wave, problem_.comm());
  travelling_->set_compliance(blocks_->compliances());
  travelling_->eliminate();
}

/// About any other motion. Collective.
void WheelPreconditioner::eliminate_by_sector() {
  travelling_.reset();
  const auto G = of_one_sector();
  contact_.eliminate(G);
  blocks_->couple(G);
}

/// A^-1 (x - B^T E B A^-1 x) of this rank's harmonic blocks. Collective.
std::vector<double> WheelPreconditioner::solve(double const* x) const {
  static const log::Event waves("FwWaves");
  const log::Span span(waves);
  Harmonics const& h = problem_.harmonics();
  const auto q = blocks_->solve(dofs_.to_waves(gather(x)), [this](std::vector<complex> const& u) {
    const auto sectors = rows_.to_sectors(u);
    static const log::Event eliminated("FwEliminated");
    const log::Span of_contact(eliminated);
    return rows_.to_waves(travelling_ ? travelling_->apply(sectors) : contact_.apply(sectors));
  });
  const auto out = dofs_.to_sectors(q);
  std::vector<double> z(size_t(local_sectors_) * unit_ * m_);
  for (int j = 0; j < local_sectors_; ++j)
    for (int i = 0; i < harmonics_; ++i)
      for (int p = 0; p < unit_; ++p) {
        const complex a = out[(size_t(j) * harmonics_ + i) * unit_ + p];
        double* at = &z[(size_t(j) * unit_ + mean_.dof(p)) * m_ + h.offset(i)];
        at[0] = a.real();
        if (h.orders()[i]) at[1] = -a.imag();
      }
  return z;
}

/// Columns of the unfolding and of the scalars; rows of the normalisation, the unfolding and the closing.
void WheelPreconditioner::make_border(Vec y, Vec row) {
  model::Model const& model = problem_.model();
  Harmonics const& h = problem_.harmonics();
  const size_t local = size_t(model.local_dofs()) * m_;
  std::vector<Border::Local> columns, rows;
  const auto copy = [&](Vec v) {
    const ReadArray in(v);
    return Border::Local(in.data(), in.data() + local);
  };
  for (auto const& g : problem_.unfolding().vectors()) columns.push_back(copy(g));
  for (int part = 0; part < problem_.scalar_count() - 1; ++part) {
    rows.emplace_back(local, 0.0);
    for (auto const& [dof, weight] : problem_.row()) {
      const PetscInt own = dof - model.first_dof();
      if (own >= 0 && own < model.local_dofs())
        rows.back()[own * m_ + h.offset(h.fundamental()) + part] = weight;
    }
  }
  rows.insert(rows.end(), columns.begin(), columns.end());
  for (int j = 0; j < problem_.scalar_count(); ++j) columns.push_back(copy(problem_.scalar_column(y, j)));
  rows.push_back(copy(row));
  const size_t size = rows.size();
  std::vector<double> S(size * size, 0.0);
  if (problem_.last_rank()) {
    const ReadArray closing(row);
    for (size_t j = 0; j < size; ++j) S[j * size + size - 1] = closing[PetscInt(local + j)];
  }
  MPI_Bcast(S.data(), int(S.size()), MPI_DOUBLE, comm_size(problem_.comm()) - 1, problem_.comm());
  border_.make([this](double const* x) { return solve(x); }, columns, std::move(rows), std::move(S),
               problem_.comm());
}

void WheelPreconditioner::build(Vec y, Vec row) {
  const Exponents e = problem_.scaled(y).exponents;
  auto contacts = problem_.pair_tangents(y);
  contact_.take(contacts);
  const auto shares = spectrum(y);
  if (!blocks_) choose_blocks(e);
  const auto main = std::ranges::max_element(shares);
  WaveBlocks::Point point{e, {}, *main >= pure};
  for (const double share : shares) point.moving.push_back(problem_.scalar_count() > 1 && share > 0);
  blocks_->make(point);
  eliminate(point.travelling, int(main - shares.begin()));
  make_border(y, row);
}

void WheelPreconditioner::apply(Vec x, Vec z) { border_.apply(ReadArray(x).data(), WriteArray(z).data()); }

/// Five applications for the border; the waves' blocks and the contact's elimination, 16/3 n^3 flops a
/// sector, at the speed of matrix products, against an application's matrices that are read from memory.
double WheelPreconditioner::build_cost() const {
  const double size = 2.0 * contact_.largest_group() * harmonics_ / m_, n = unit_;
  const double waves = double(std::max<size_t>(dofs_.waves().size(), 1));
  return 6 + ((blocks_ ? blocks_->flops() : 4 * n * n * n * sectors_) / waves * harmonics_ +
              16.0 / 3 * size * size * size) /
                 10 / ((blocks_ ? blocks_->applied_flops() : 8 * n * n * waves) / waves * harmonics_);
}

std::string WheelPreconditioner::describe() const {
  char text[160];
  std::snprintf(text, sizeof text, "%d nodal diameters of %d dofs by their %s, %.0f MB on rank 0", sectors_,
                unit_, blocks_ ? blocks_->describe().c_str() : "blocks",
                blocks_ ? blocks_->megabytes() : 0.0);
  return text;
}

void register_kinds() {
  const auto whole_wheel = [](HarmonicProblem const& problem) { return problem.model().unit() > 0; };
  const auto not_waves = [=](HarmonicProblem const& problem) -> std::string {
    if (!whole_wheel(problem)) return "a model that is no whole wheel";
    return WheelPreconditioner::suits(problem) ? "" : "contact not the same in all sectors";
  };
  auto wheels = harmonic_kind<WheelPreconditioner>("fwwheel", "", whole_wheel, not_waves);
  wheels.one_factor = true;
  solve::register_kind(std::move(wheels));
}

}  // namespace fretwave::wheel
