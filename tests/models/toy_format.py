"""A reader of matrix files in one file, as a case names it under `plugins`: a heading, then row, column and value."""

import numpy as np
from scipy.sparse import coo_matrix

import fretwave as fw


@fw.register_format(".tri")
def read(path, letter, variable):
    row, column, value = np.loadtxt(path, skiprows=1, unpack=True, ndmin=2)
    return coo_matrix((value, (row.astype(int) - 1, column.astype(int) - 1)))
