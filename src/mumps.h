#pragma once
#include <algorithm>
#include <string>

#include "petsc.h"

namespace fretwave {

/// MUMPS gives large counts in millions, with a minus sign.
inline double large_count(double count) { return count < 0 ? -1e6 * count : count; }

/// What MUMPS' own interface, which lives beside PETSc's, is handled by whatever its numbers are: of
/// `dmumps_c` or `zmumps_c`, and their structure.
template <class Structure, void (*call)(Structure*)>
class Mumps {
 public:
  enum Job { begin = -1, end = -2, analyse = 1, factorise = 2, solve = 3 };

  /// Entries stay with the ranks that give them. Collective.
  Mumps(MPI_Comm comm, bool symmetric) {
    id.comm_fortran = MPI_Comm_c2f(comm);
    id.par = 1;
    id.sym = symmetric ? 2 : 0;
    run(begin);
    for (int k : {1, 2, 3}) icntl(k) = -1;  // no output
    icntl(4) = 0;
    icntl(14) = 50;  // workspace beyond the estimate [%]
    icntl(18) = 3;   // entries distributed
    icntl(28) = 1;   // sequential analysis: the parallel one needs an ordering that Debian leaves out
  }
  ~Mumps() {
    int finalised;
    MPI_Finalized(&finalised);
    if (!finalised) run(end);
  }
  Mumps(Mumps const&) = delete;

  auto& icntl(int k) { return id.icntl[k - 1]; }
  int status() const { return id.infog[0]; }
  void run(Job job) {
    id.job = job;
    call(&id);
  }
  /// What users set of it by PETSc's names for its numbers, -<prefix>mat_mumps_icntl_<k> and cntl; not what
  /// says where entries and right sides lie, which pivots are counted as null, what is solved for and refined
  /// (entries are given away by then).
  void take_options(std::string const& prefix) {
    constexpr int ours[] = {1, 2, 3, 4, 5, 10, 11, 13, 18, 19, 20, 21, 24, 25, 26, 30, 31, 32};
    constexpr int null_pivots = 3;
    PetscBool given;
    for (int k = 1; k <= 40; ++k) {
      if (std::ranges::count(ours, k) > 0) continue;
      PetscInt value = icntl(k);
      const auto name = "-mat_mumps_icntl_" + std::to_string(k);
      check(PetscOptionsGetInt(nullptr, prefix.c_str(), name.c_str(), &value, &given));
      icntl(k) = int(value);
    }
    for (int k = 1; k <= 7; ++k) {
      if (k == null_pivots) continue;
      const auto name = "-mat_mumps_cntl_" + std::to_string(k);
      check(PetscOptionsGetReal(nullptr, prefix.c_str(), name.c_str(), &id.cntl[k - 1], &given));
    }
  }
  /// Again with more workspace, where that was short.
  void run_factorise() {
    constexpr int workspace_short[] = {-8, -9, -14, -15, -17, -20};  // INFOG(1)
    for (int attempt = 0; attempt < 5; ++attempt, icntl(14) = std::max(2 * icntl(14), 50)) {
      run(factorise);
      if (std::ranges::count(workspace_short, status()) == 0) return;
    }
  }
  /// Why it failed, where not of the matrix.
  void need(std::string const& what) const {
    if (status() >= 0) return;
    if (status() == -13)
      throw RankFailure(
          "there is not enough memory for the sparse factors",
          "MUMPS INFOG(1) = -13, INFOG(2) = " + std::to_string(id.infog[1]),
          "use more ranks on more machines, fewer harmonics where each has its own, or a reduced model");
    throw PetscFailure("MUMPS cannot " + what + ": INFOG(1) = " + std::to_string(status()) +
                       ", INFOG(2) = " + std::to_string(id.infog[1]));
  }
  /// Over all ranks [MB].
  double megabytes() const { return id.infog[21]; }
  /// Of the factors.
  double entries() const { return large_count(id.infog[28]); }

  Structure id{};
};

}  // namespace fretwave
