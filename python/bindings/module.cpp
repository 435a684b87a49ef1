#include <slepcsys.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <algorithm>
#include <cstdlib>
#include <tuple>

#include "blas_kernels.h"
#include "casters.h"
#include "error.h"
#include "fault.h"
#include "flat_product.h"
#include "log.h"
#include "precondition/kinds.h"
#include "together.h"
#include "tuned.h"
#include "wheel/wheel_pc.h"

namespace fretwave::python {

namespace {

/// C++ errors become the package's own: fretwave.errors.InputError and PetscError.
void translate(std::exception_ptr const& pointer, void*) {
  const auto raise = [](char const* name, nb::object error) {
    PyErr_SetObject(nb::module_::import_("fretwave.errors").attr(name).ptr(), error.ptr());
  };
  const auto text = [](std::string const& s) -> nb::object {
    return s.empty() ? nb::none() : nb::object(nb::cast(s));
  };
  try {
    std::rethrow_exception(pointer);
  } catch (InputError const& e) {
    nb::object type = nb::module_::import_("fretwave.errors").attr("InputError");
    raise("InputError", type(e.what(), text(e.where), text(e.measured), text(e.expected), text(e.fix)));
  } catch (Interrupted const&) {
    PyErr_SetNone(PyExc_KeyboardInterrupt);
  } catch (RankFailure const& e) {
    nb::object type = nb::module_::import_("fretwave.errors").attr("FretwaveError");
    raise("FretwaveError", type(e.what(), text(e.where), nb::none(), nb::none(), text(e.fix)));
  } catch (SingularBlock const& e) {
    nb::object type = nb::module_::import_("fretwave.errors").attr("FretwaveError");
    raise("FretwaveError", type(e.what()));
  } catch (PetscFailure const& e) {
    nb::object type = nb::module_::import_("fretwave.errors").attr("PetscError");
    raise("PetscError", type(e.what()));
  }
}

/// An interrupt, or an InputError, of a law in Python as the core's, which goes over to other ranks whole.
void read_foreign_error(std::exception const& error) {
  auto const* python = dynamic_cast<nb::python_error const*>(&error);
  if (!python) return;
  if (python->matches(PyExc_KeyboardInterrupt)) throw Interrupted();
  if (!python->matches(nb::module_::import_("fretwave.errors").attr("InputError"))) return;
  const auto said = [&](char const* name) {
    const nb::object value = python->value().attr(name);
    return value.is_none() ? std::string() : std::string(nb::str(value).c_str());
  };
  throw InputError(said("what"), said("measured"), said("expected"), said("fix"), said("where"));
}

/// Options given but read by nothing: most often misspelt.
std::vector<std::string> unused_options() {
  PetscInt n;
  char **names, **values;
  check(PetscOptionsLeftGet(nullptr, &n, &names, &values));
  std::vector<std::string> out(names, names + n);
  check(PetscOptionsLeftRestore(nullptr, &n, &names, &values));
  return out;
}

/// SuperLU_DIST, which comes with PETSc, tells glibc as it is loaded never to give memory back (M_MMAP_MAX
/// and M_TRIM_THRESHOLD): a process kept the most that it ever had. Blocks from 32 MB on are the system's
/// again once they are freed, as they are without that library; smaller ones are made too often for it.
void give_memory_back() {
#ifdef __GLIBC__
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_MMAP_MAX, 65536);
  mallopt(M_TRIM_THRESHOLD, 256 << 20);
#endif
}

/// petsc4py ends PETSc as Python ends, which waits on each rank for others that have objects left. Cycles of
/// Python's hold them, an exception's frames above all, on one rank and not on another: they are collected
/// before, for what is registered last is called first. What a script holds on one rank to its end is not:
/// PETSc's communicator is kept, or that rank alone still had it.
void collect_before_petsc_ends() {
  if (comm_size(PETSC_COMM_WORLD) == 1) return;
  MPI_Comm kept;
  check(PetscCommDuplicate(PETSC_COMM_WORLD, &kept, nullptr));
  nb::module_::import_("atexit").attr("register")(nb::module_::import_("gc").attr("collect"));
}

/// beta C + alpha B A, or B^T A, of few columns, by rows; into C.
template <class Real>
void flat_product_added(Rows<Real> B, Rows<Real> A, bool transposed, Real alpha, Real beta,
                        nb::ndarray<Real, nb::ndim<2>, nb::c_contig, nb::device::cpu> C) {
  const size_t k = A.shape(0), m = A.shape(1), n = B.shape(transposed ? 1 : 0);
  if (B.shape(transposed ? 0 : 1) != k || C.shape(0) != n || C.shape(1) < m)
    throw std::invalid_argument("a product of matrices that do not fit");
  lapack::multiply_flat(transposed, int(m), int(n), int(k), alpha, A.data(), int(m), B.data(),
                        int(B.shape(1)), beta, C.data(), int(C.shape(1)));
}

/// B A, or B^T A, of few columns, by rows.
template <class Real>
nb::ndarray<nb::numpy, Real> flat_product(Rows<Real> B, Rows<Real> A, bool transposed) {
  const size_t m = A.shape(1), n = B.shape(transposed ? 1 : 0);
  Real* C = new Real[n * m];
  const nb::capsule owner(C, [](void* p) noexcept { delete[] static_cast<Real*>(p); });
  flat_product_added<Real>(B, A, transposed, 1, 0, {C, {n, m}, owner});
  return nb::ndarray<nb::numpy, Real>(C, {n, m}, owner);
}

/// Formats of -log_view that say what was called by what need it from the beginning on.
void begin_log(bool nested) {
  static bool is_nested = false;
  if (!is_nested) check(nested ? PetscLogNestedBegin() : PetscLogDefaultBegin());
  is_nested |= nested;
}

}  // namespace

NB_MODULE(_core, m) {
  import_petsc4py_module();  // initialises PETSc
  collect_before_petsc_ends();
  give_memory_back();
  mend_blas_kernels();
  check(SlepcInitializeNoArguments());
  log::register_events();
  wheel::register_kinds();
  precondition::register_kinds();
  fault::arm_from(std::getenv("FRETWAVE_FAULT"), comm_rank(PETSC_COMM_WORLD));
  nb::register_exception_translator(translate);
  read_foreign_errors_by(read_foreign_error);
  // a script's model holds its law in Python, whose functions hold the script: at its end none is freed
  nb::set_leak_warnings(false);
  m.doc() = "C++ core of fretwave; use the package's own classes";
  m.def("arm_fault", fault::arm,
        "Lets this process fail at the count-th pass of a named place (src/fault.h).");
  m.def(
      "fault_point", [](std::string const& place) { fault::point(place.c_str()); },
      "A place in Python at which a fault may be armed.");
  m.def("blas_kernels", blas_kernels,
        "What OpenBLAS runs on this machine, such as 'SkylakeX'; empty with another BLAS.");
  m.def("flat_product", flat_product<double>, nb::arg("B"), nb::arg("A"), nb::arg("transposed") = false,
        "B A, or B^T A, as dense matrices multiply the coefficients of all dofs: A has few columns.");
  m.def("flat_product", flat_product<float>, nb::arg("B"), nb::arg("A"), nb::arg("transposed") = false);
  m.def("flat_product_added", flat_product_added<double>,
        "beta C + alpha B A, or B^T A, into the first columns of C.");
  m.def("flat_product_added", flat_product_added<float>);
  m.def("keep_registers_narrow", lapack::keep_registers_narrow,
        "Flat products take registers of AVX2 alone from here on, as on a machine without AVX-512.");
  m.def(
      "tuned_constants",
      [] {
        std::vector<std::tuple<std::string, double, std::string>> out;
        for (auto const* one : Tuned::all())
          out.emplace_back("fw_" + one->name(), one->value(), one->meaning());
        std::ranges::sort(out);
        return out;
      },
      "Option, value without it and meaning of each tuned constant of the core.");
  m.def(
      "exchange",
      [](MPI_Fint comm, std::vector<std::vector<double>> const& to, size_t arriving) {
        std::vector<double> out, in(arriving);
        std::vector<int> sent;
        for (auto const& numbers : to) {
          out.insert(out.end(), numbers.begin(), numbers.end());
          sent.push_back(int(numbers.size()));
        }
        wheel::TwoStageExchange{MPI_Comm_f2c(comm)}(out, sent, in);
        return in;
      },
      nb::arg("comm"), nb::arg("to"), nb::arg("arriving"),
      "What each rank has for each, as the parts of a wheel exchange it: numbers for each rank of a "
      "communicator (mpi4py's `py2f`); returns the "
      "`arriving` "
      "numbers for this one, by rank. Collective.");
  m.def("begin_log", begin_log, nb::arg("nested"), "PETSc counts events from here on. Collective.");
  m.def("unused_options", unused_options, "PETSc options that were set and that nothing has read.");
  bind_contact(m);
  bind_model(m);
  bind_solve(m);
  bind_hb(m);
  bind_transient(m);
  bind_interrupt(m);
}

}  // namespace fretwave::python
