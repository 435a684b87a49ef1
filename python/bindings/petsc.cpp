#include <petsc4py/petsc4py.h>

#include "casters.h"

// petsc4py's C interface is per translation unit: all of it is used here.
namespace fretwave::python {

void import_petsc4py_module() {
  if (import_petsc4py() < 0) throw nb::python_error();
}

bool from_petsc4py(PyObject* source, Vec* v) {
  if (!PyObject_TypeCheck(source, &PyPetscVec_Type)) return false;
  *v = PyPetscVec_Get(source);
  return *v != nullptr;
}

bool from_petsc4py(PyObject* source, Mat* A) {
  if (!PyObject_TypeCheck(source, &PyPetscMat_Type)) return false;
  *A = PyPetscMat_Get(source);
  return *A != nullptr;
}

bool from_petsc4py(PyObject* source, SNES* snes) {
  if (!PyObject_TypeCheck(source, &PyPetscSNES_Type)) return false;
  *snes = PyPetscSNES_Get(source);
  return *snes != nullptr;
}

PyObject* to_petsc4py(Vec v) { return PyPetscVec_New(v); }
PyObject* to_petsc4py(Mat A) { return PyPetscMat_New(A); }
PyObject* to_petsc4py(SNES snes) { return PyPetscSNES_New(snes); }

}  // namespace fretwave::python
