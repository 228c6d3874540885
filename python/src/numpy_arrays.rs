//! Arrays of numpy: those that are given, and those that are made.

use nalgebra::Matrix3;
use ndarray::Dimension;
use numpy::{
    Element, PyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::{
    exceptions::PyTypeError,
    prelude::*,
    types::{IntoPyDict, PyDict},
};

pub fn given<'py, T: Element, D: Dimension>(
    array: &Bound<'py, PyAny>,
    name: &str,
    expected: &str,
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    let given = array.cast::<PyArray<T, D>>().cloned();
    given.map_err(|_| {
        let is = match array.cast::<PyUntypedArray>() {
            Ok(it) => format!("an array of {} with shape {:?}", it.dtype(), it.shape()),
            Err(_) => format!("of type {}", array.get_type()),
        };
        PyTypeError::new_err(format!("{name} is {is}, expected {expected}"))
    })
}

/// Borrows an object as an array that Rust reads. Type and shape are looked at each time: numpy can
/// change both in place.
pub fn readable<'py, T: Element, D: Dimension>(
    array: &Bound<'py, PyAny>,
    name: &str,
    expected: &str,
) -> PyResult<PyReadonlyArray<'py, T, D>> {
    Ok(given(array, name, expected)?.try_readonly()?)
}

/// Converts an object to an array of elements `T` that a slice of Rust can have: C-contiguous and
/// aligned. One that is so is not copied; a view of packed records is.
pub fn sliceable<'py, T: Element>(value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let py = value.py();
    let keywords =
        [("requirements", ["C_CONTIGUOUS", "ALIGNED", "ENSUREARRAY"])].into_py_dict(py)?;
    let numpy = py.import("numpy")?;
    numpy.call_method("require", (value, T::get_dtype(py)), Some(&keywords))
}

/// Converts what numpy can convert without loss of kind, as a list of int or an array of float64,
/// to an array of one dimension.
pub fn converted<'py, T: Element>(
    value: &Bound<'py, PyAny>,
    name: &str,
    expected: &str,
) -> PyResult<Bound<'py, PyArray1<T>>> {
    let py = value.py();
    let keywords = PyDict::new(py);
    keywords.set_item("casting", "same_kind")?;
    keywords.set_item("copy", false)?;
    let numpy = py.import("numpy")?;
    let array = numpy.call_method1("asarray", (value,))?;
    let cast = array.call_method("astype", (T::get_dtype(py),), Some(&keywords));
    let cast = cast.map_err(|error| {
        PyTypeError::new_err(format!("{name}: {}, expected {expected}", error.value(py)))
    })?;
    given(&sliceable::<T>(&cast)?, name, expected)
}

pub fn matrix<'py>(py: Python<'py>, matrix: &Matrix3<f64>) -> Bound<'py, PyArray2<f64>> {
    let element = |(row, column)| matrix[(row, column)];
    PyArray2::from_owned_array(py, ndarray::Array2::from_shape_fn((3, 3), element))
}
