#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/complex.h>
#include <nanobind/stl/function.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cstdint>
#include <type_traits>

#include "petsc.h"

namespace nb = nanobind;

namespace fretwave::python {

/// petsc4py objects in and out. A plain caster for Vec would strip the pointer, hence the struct. Borrowed on
/// the way in, one reference more out.
template <class T>
struct Petsc {
  T object = nullptr;
};

/// As annotations have them.
template <class T>
constexpr auto petsc_name() {
  if constexpr (std::is_same_v<T, Vec>)
    return nb::detail::const_name("petsc4py.PETSc.Vec");
  else if constexpr (std::is_same_v<T, Mat>)
    return nb::detail::const_name("petsc4py.PETSc.Mat");
  else
    return nb::detail::const_name("petsc4py.PETSc.SNES");
}

/// A new object on its way to Python.
template <class T>
struct Handed {
  nb::object object;
};

bool from_petsc4py(PyObject*, Vec*);
bool from_petsc4py(PyObject*, Mat*);
bool from_petsc4py(PyObject*, SNES*);
PyObject* to_petsc4py(Vec);
PyObject* to_petsc4py(Mat);
PyObject* to_petsc4py(SNES);
void import_petsc4py_module();

inline Handed<Vec> handed(Vec v) { return {nb::steal(to_petsc4py(v))}; }
inline Handed<Mat> handed(Mat A) { return {nb::steal(to_petsc4py(A))}; }
inline Handed<SNES> handed(SNES snes) { return {nb::steal(to_petsc4py(snes))}; }

using Array = nb::ndarray<nb::numpy, double>;
/// A matrix from Python, row by row.
template <class Real>
using Rows = nb::ndarray<Real const, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

/// A numpy array that owns a copy of the data.
inline Array numpy_copy(double const* data, std::vector<size_t> const& shape) {
  size_t n = 1;
  for (size_t s : shape) n *= s;
  double* copy = new double[n ? n : 1];
  std::copy_n(data, n, copy);
  nb::capsule owner(copy, [](void* p) noexcept { delete[] static_cast<double*>(p); });
  return Array(copy, shape.size(), shape.data(), owner);
}

/// A numpy array of small whole numbers, from values that become such.
template <class T>
inline nb::ndarray<nb::numpy, std::int8_t> numpy_bytes(std::vector<T> const& values,
                                                       std::vector<size_t> const& shape) {
  auto* copy = new std::int8_t[values.size() + 1];
  std::transform(values.begin(), values.end(), copy, [](T value) { return std::int8_t(value); });
  nb::capsule owner(copy, [](void* p) noexcept { delete[] static_cast<std::int8_t*>(p); });
  return nb::ndarray<nb::numpy, std::int8_t>(copy, shape.size(), shape.data(), owner);
}

void bind_contact(nb::module_&);
void bind_model(nb::module_&);
void bind_hb(nb::module_&);
void bind_solve(nb::module_&);
void bind_transient(nb::module_&);
void bind_interrupt(nb::module_&);

}  // namespace fretwave::python

namespace nanobind::detail {

template <class T>
struct type_caster<fretwave::python::Petsc<T>> {
  NB_TYPE_CASTER(fretwave::python::Petsc<T>, fretwave::python::petsc_name<T>())
  bool from_python(handle source, uint8_t, cleanup_list*) noexcept {
    return fretwave::python::from_petsc4py(source.ptr(), &value.object);
  }
  static handle from_cpp(fretwave::python::Petsc<T> source, rv_policy, cleanup_list*) noexcept {
    return fretwave::python::to_petsc4py(source.object);
  }
};

template <class T>
struct type_caster<fretwave::python::Handed<T>> {
  NB_TYPE_CASTER(fretwave::python::Handed<T>, fretwave::python::petsc_name<T>())
  bool from_python(handle, uint8_t, cleanup_list*) noexcept { return false; }
  static handle from_cpp(fretwave::python::Handed<T> source, rv_policy, cleanup_list*) noexcept {
    return source.object.release();
  }
};

}  // namespace nanobind::detail
