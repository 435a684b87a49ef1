"""Tables, journals and files of runs; reading them needs no MPI."""
