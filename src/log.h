#pragma once
#include "petsc.h"

/// Parts of the work by name in PETSc's -log_view.
namespace fretwave::log {

/// Makes all events known, once: PETSc's nested formats tell them by their numbers, which have to be the same
/// on all ranks, whatever one rank does alone.
void register_events();
/// The number of a registered one.
PetscLogEvent event_named(char const* name);

/// One of those that are registered, of at most 16 letters.
class Event {
 public:
  explicit Event(char const* name) : event_(event_named(name)) {}
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
