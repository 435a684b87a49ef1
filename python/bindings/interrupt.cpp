#include <signal.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "casters.h"

namespace fretwave::python {

namespace {

/// What is told to end: by a person, a batch system, a terminal that closes, a limit on time.
struct Ending {
  int number;
  char const* name;
  struct sigaction before;
};
std::array<Ending, 4> endings{
    {{SIGINT, "SIGINT", {}}, {SIGTERM, "SIGTERM", {}}, {SIGHUP, "SIGHUP", {}}, {SIGXCPU, "SIGXCPU", {}}}};
std::array<char, 4096> words;
size_t length = 0;
int code = 1;
struct timespec last_wait = {0, 0};
bool installed = false;

void say(char const* text, size_t count) {
  while (count > 0) {
    ssize_t const written = write(STDERR_FILENO, text, count);
    if (written <= 0) return;
    text += written;
    count -= static_cast<size_t>(written);
  }
}

/// Says the last words and ends the process. Python would look at a signal only between two points of a
/// branch, hours later perhaps; files may be left at any instant, for what is written to them is in order and
/// has checksums.
void end(int number) {
  if (length > 0) {
    say("interrupted by ", 15);
    for (Ending const& ending : endings)
      if (ending.number == number) say(ending.name, std::strlen(ending.name));
    say(words.data(), length);
    nanosleep(&last_wait, nullptr);
  }
  _exit(code);
}

/// Words of a process that is told to end; none are said where they are empty (all ranks but one).
void set_last_words(std::string const& text) {
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  length = std::min(text.size(), words.size());
  std::copy_n(text.data(), length, words.data());
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

/// `wait` [s] before the end: a launcher that hears of it drops what it has not read yet.
void end_on_signals(int exit_code, double wait) {
  if (installed) return;
  code = exit_code;
  last_wait.tv_nsec = static_cast<long>(1e9 * std::clamp(wait, 0.0, 0.9));
  for (Ending& ending : endings) {
    struct sigaction action = {};
    action.sa_handler = end;
    sigfillset(&action.sa_mask);
    sigaction(ending.number, nullptr, &ending.before);
    if (ending.before.sa_handler != SIG_IGN)
      sigaction(ending.number, &action, nullptr);  // nohup stays what it is
  }
  installed = true;
}

void restore_signals() {
  if (!installed) return;
  for (Ending const& ending : endings) sigaction(ending.number, &ending.before, nullptr);
  installed = false;
}

}  // namespace

void bind_interrupt(nb::module_& m) {
  m.def("set_last_words", set_last_words,
        "What is printed after the name of the signal that ends the process.");
  m.def("end_on_signals", end_on_signals,
        "End on SIGINT, SIGTERM, SIGHUP and SIGXCPU at once, with the last words.");
  m.def("restore_signals", restore_signals, "Undo `end_on_signals`.");
}

}  // namespace fretwave::python
