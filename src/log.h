#pragma once
#include "petsc.h"

/// Parts of the work by name in PETSc's -log_view.
namespace fretwave::log {

/// Registered once; the name has at most 16 letters.
class Event {
 public:
  explicit Event(char const* name) {
    static const PetscClassId id = [] {
      PetscClassId made;
      check(PetscClassIdRegister("fretwave", &made));
      return made;
    }();
    check(PetscLogEventRegister(name, id, &event_));
  }
  operator PetscLogEvent() const { return event_; }

 private:
  PetscLogEvent event_;
};

/// An event from here to the end of the block.
class Span {
 public:
  explicit Span(PetscLogEvent event) : event_(event) { begin(); }
  ~Span() { (void)end(); }
  Span(Span const&) = delete;

 private:
  PetscErrorCode begin() { return PetscLogEventBegin(event_, 0, 0, 0, 0); }
  PetscErrorCode end() { return PetscLogEventEnd(event_, 0, 0, 0, 0); }
  PetscLogEvent event_;
};

}  // namespace fretwave::log
