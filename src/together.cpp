#include "together.h"

#include <new>
#include <utility>

#include "error.h"

namespace fretwave {

namespace {

enum class Kind : int { other, memory, input, singular, petsc, interrupt };

/// An exception as it goes from one rank to the others: its kind and its texts, each ended by a zero.
struct Message {
  Kind kind = Kind::other;
  std::string texts;

  void add(std::string text) {
    std::erase(text, '\0');
    texts += text + '\0';
  }
  std::string take() {
    const auto end = texts.find('\0');
    std::string first = texts.substr(0, end);
    texts.erase(0, end + 1);
    return first;
  }
};

void (*read_foreign)(std::exception const&) = nullptr;

/// What an exception says, and where: one of Python has a traceback before its words, of which the last line
/// tells the place.
std::pair<std::string, std::string> words_and_place(std::string text) {
  const std::string head = "Traceback (most recent call last):\n", frame = "  File ";
  if (!text.starts_with(head)) return {text, ""};
  std::string place;
  text.erase(0, head.size());
  for (size_t end; text.starts_with(frame) && (end = text.find('\n')) != std::string::npos;) {
    place = text.substr(2, end - 2);
    text.erase(0, end + 1);
  }
  return {text, place};
}

Message message_of(InputError const& e) {
  Message out{Kind::input, ""};
  for (auto const& text : {std::string(e.what()), e.measured, e.expected, e.fix, e.where}) out.add(text);
  return out;
}

Message message_of(std::exception_ptr const& failure);

/// Of an exception that is none of the core's own.
Message message_of_other(std::exception const& e) {
  try {
    if (read_foreign) read_foreign(e);
  } catch (...) {
    return message_of(std::current_exception());
  }
  Message out;
  auto const [words, place] = words_and_place(e.what());
  out.add(words), out.add(place);
  return out;
}

Message message_of(std::exception_ptr const& failure) {
  Message out;
  try {
    std::rethrow_exception(failure);
  } catch (InputError const& e) {
    return message_of(e);
  } catch (SingularBlock const& e) {
    out.kind = Kind::singular, out.add(e.what());
  } catch (PetscFailure const& e) {
    out.kind = Kind::petsc, out.add(e.what());
  } catch (std::bad_alloc const&) {
    out.kind = Kind::memory;
  } catch (Interrupted const&) {
    out.kind = Kind::interrupt;
  } catch (std::exception const& e) {
    return message_of_other(e);
  } catch (...) {
    out.add("an exception without words"), out.add("");
  }
  return out;
}

[[noreturn]] void raise(Message message, std::string const& task, int rank) {
  const std::string where = "rank " + std::to_string(rank) + ", " + task;
  switch (message.kind) {
    case Kind::input: {
      const auto what = message.take(), measured = message.take(), expected = message.take(),
                 fix = message.take();
      throw InputError(what, measured, expected, fix, message.take());
    }
    case Kind::singular:
      throw SingularBlock(message.take());
    case Kind::petsc:
      throw PetscFailure(message.take() + " (" + where + ")");
    case Kind::memory:
      throw RankFailure("there is not enough memory", where,
                        "use more ranks on more machines, fewer harmonics or a reduced model");
    case Kind::interrupt:
      throw Interrupted();
    case Kind::other:
      break;
  }
  const auto what = message.take(), place = message.take();
  throw RankFailure(what, place.empty() ? where : where + ", " + place,
                    "mend the law if it is one of your own; report it otherwise");
}

}  // namespace

void read_foreign_errors_by(void (*reader)(std::exception const&)) { read_foreign = reader; }

void agree(MPI_Comm comm, char const* task, std::exception_ptr failure) {
  const int rank = comm_rank(comm), ranks = comm_size(comm);
  int first = failure ? rank : ranks;
  MPI_Allreduce(MPI_IN_PLACE, &first, 1, MPI_INT, MPI_MIN, comm);
  if (first == ranks) return;
  Message message;
  if (rank == first) message = message_of(failure);
  int head[2] = {int(message.kind), int(message.texts.size())};
  MPI_Bcast(head, 2, MPI_INT, first, comm);
  message.kind = Kind(head[0]), message.texts.resize(size_t(head[1]));
  MPI_Bcast(message.texts.data(), head[1], MPI_CHAR, first, comm);
  raise(std::move(message), task, first);
}

}  // namespace fretwave
