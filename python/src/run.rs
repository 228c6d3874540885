//! Running runs: their topics, whose messages are read in shared memory, and their control.

use std::{path::PathBuf, rc::Rc, time::Duration};

use gyre_client::{AnyMessage, MAX_WAIT, TopicObserver, control::Control, wait_for_readable};
use gyre_contract::{
    self as contract, Masked, MaskedHeader, Scan, ScanHeader, Topic, topic_named,
    wire::{Bounds, Described, Kind, Number, Structure, Value},
};
use gyre_geometry::{SparsePoint, covariance};
use pyo3::{
    exceptions::PyAttributeError,
    prelude::*,
    types::{PyDict, PyList, PyTuple},
};

use crate::{errors, numpy_arrays, values};

/// A run that is running on this machine.
///
/// `Run("out/robot")` attaches to the run that writes its results to this folder, `Run()` to the
/// only one. `poses()`, `scans()` and the others, and `observe(topic)` for each name in `topics`,
/// are iterators over the last messages and the new ones, until the run ends. It changes nothing in
/// a run: a slow loop misses messages, which are counted.
#[pyclass(module = "gyre", unsendable, frozen)]
pub struct Run(gyre_client::Run);

#[pymethods]
impl Run {
    #[new]
    #[pyo3(signature = (out=None))]
    fn new(out: Option<PathBuf>) -> PyResult<Self> {
        let run = match out {
            Some(out) => gyre_client::Run::open(out),
            None => gyre_client::Run::only(),
        };
        run.map(Self).map_err(errors::run)
    }

    /// The folder of the results.
    #[getter]
    fn out(&self) -> PathBuf {
        self.0.manifest().out.clone()
    }

    /// The names of the topics, in the order of the data.
    #[getter]
    fn topics(&self) -> Vec<&'static str> {
        let topics = contract::all().map(|topic| topic.name);
        topics
            .filter(|it| self.0.manifest().has_topic(it))
            .collect()
    }

    /// True when the run has ended, with its results written.
    #[getter]
    fn has_ended(&self) -> bool {
        self.0.has_ended()
    }

    /// Follows a topic by its name.
    fn observe(&self, topic: &str) -> PyResult<Messages> {
        let topic = topic_named(topic).map_err(errors::run)?;
        let observer = self.0.observe_topic(topic).map_err(errors::run)?;
        let current = None;
        Ok(Messages {
            observer,
            topic,
            current,
        })
    }

    /// Poses of the radar in the frame of the first scan.
    fn poses(&self) -> PyResult<Messages> {
        self.observe("pose")
    }

    /// Scans as measured: `power` is uint8 (azimuths, range bins).
    fn scans(&self) -> PyResult<Messages> {
        self.observe("scan")
    }

    /// Masked scans: `raster` is float32 (n, n), `points` float32 (points, 5).
    fn points(&self) -> PyResult<Messages> {
        self.observe("masked")
    }

    /// Moving objects, with `objects.kind = "tracks"`.
    fn objects(&self) -> PyResult<Messages> {
        self.observe("objects")
    }

    /// With SLAM: the pose of the odometry frame in the map frame.
    fn corrections(&self) -> PyResult<Messages> {
        self.observe("correction")
    }

    /// With a map: places in it.
    fn fixes(&self) -> PyResult<Messages> {
        self.observe("fix")
    }

    /// Returns the state of the run and of its processes as a dictionary.
    fn status<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        values::dictionary(py, &self.control()?.status().map_err(errors::run)?)
    }

    /// Restarts a process of the run by its name.
    fn restart(&self, process: &str) -> PyResult<()> {
        self.control()?.restart(process).map_err(errors::run)
    }

    /// Ends the run. The same command continues it.
    fn down(&self) -> PyResult<()> {
        self.control()?.stop().map_err(errors::run)
    }

    fn __repr__(&self) -> String {
        format!("<gyre.Run {}>", self.0.manifest().out.display())
    }
}

impl Run {
    fn control(&self) -> PyResult<Control> {
        self.0.control().map_err(errors::run)
    }
}

/// The messages of a topic. The next one releases the one before.
#[pyclass(module = "gyre", unsendable)]
pub struct Messages {
    observer: TopicObserver,
    topic: &'static Topic,
    current: Option<Py<Message>>,
}

#[pymethods]
impl Messages {
    /// The number of messages that were missed so far.
    #[getter]
    fn missed(&self) -> u64 {
        self.observer.missed()
    }

    fn __iter__(this: Py<Self>) -> Py<Self> {
        this
    }

    fn __next__(&mut self, py: Python<'_>) -> PyResult<Option<Py<Message>>> {
        if let Some(before) = self.current.take() {
            before.borrow_mut(py).held = None;
        }
        // Its descriptor, so that others run while this thread waits.
        let descriptor = self.observer.listener().descriptor().map_err(errors::run)?;
        loop {
            if let Some(message) = self.observer.hold(Duration::ZERO).map_err(errors::run)? {
                let missed = message.missed;
                let message = Message {
                    held: Some(Rc::new(message)),
                    topic: self.topic,
                    missed,
                };
                let message = Py::new(py, message)?;
                self.current = Some(message.clone_ref(py));
                return Ok(Some(message));
            }
            if self.observer.has_ended() {
                return Ok(None);
            }
            py.check_signals()?;
            let waited = py.detach(|| wait_for_readable(&descriptor, MAX_WAIT));
            waited.map_err(errors::run)?;
            self.observer.listener().take().map_err(errors::run)?;
        }
    }
}

/// A message. Its attributes are the fields of its header and of its `item`, for example `seq`,
/// `scan` and `stamp_ns`: numbers, arrays, and structures. Arrays of azimuths, `power`, `raster`
/// and `points` are read-only views of shared memory; drop them before the next message.
#[pyclass(module = "gyre", unsendable)]
pub struct Message {
    held: Option<Rc<gyre_client::Message<AnyMessage>>>,
    topic: &'static Topic,
    /// The number of messages that were missed directly before this one.
    #[pyo3(get)]
    missed: u64,
}

#[pymethods]
impl Message {
    /// The name of the topic.
    #[getter]
    fn topic(&self) -> &'static str {
        self.topic.name
    }

    /// Returns all fields as a dictionary.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let held = self.held()?;
        values::dictionary(
            py,
            &self.topic.structure.values(held.received().header_bytes()),
        )
    }

    fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let held = self.held()?;
        if let Some(view) = payload(held, self.topic, name) {
            return view.into_array(py);
        }
        let header = held.received().header_bytes();
        let of = |path: &str| self.topic.structure.value(path, header);
        let Some(value) = of(name).or_else(|| of(&format!("item.{name}"))) else {
            let topic = self.topic.name;
            return Err(PyAttributeError::new_err(format!(
                "a message of `{topic}` has no field `{name}`: dir(message) lists them"
            )));
        };
        match self.topic.structure.field(name).map(|it| it.bounds) {
            Some(Bounds::Covariance) => Ok(matrix(py, &value)),
            Some(Bounds::CountedBy(_)) => match View::of(held, &value) {
                Some(view) => view.into_array(py),
                None => object(py, &value),
            },
            _ => object(py, &value),
        }
    }

    fn __dir__(&self) -> Vec<String> {
        let mut names = vec![
            "missed".to_owned(),
            "to_dict".to_owned(),
            "topic".to_owned(),
        ];
        let item = contract::Item::STRUCTURE.fields.iter();
        let fields = self.topic.structure.fields.iter().chain(item);
        names.extend(fields.map(|field| field.name.to_owned()));
        names
    }

    fn __repr__(&self) -> String {
        let Some(held) = &self.held else {
            return format!("<gyre.Message of {}, released>", self.topic.name);
        };
        let received = held.received();
        let words = (self.topic.words)(received.header_bytes(), received.values());
        format!(
            "<gyre.Message {} {}: {words}>",
            self.topic.name,
            received.item().seq
        )
    }
}

impl Message {
    fn held(&self) -> PyResult<&Rc<gyre_client::Message<AnyMessage>>> {
        self.held.as_ref().ok_or_else(|| {
            errors::run(
                "this message was released when the next one was asked for: copy what you keep",
            )
        })
    }
}

/// Elements in shared memory, which numpy reads by the array interface.
#[pyclass(module = "gyre", unsendable)]
struct View {
    /// Keeps the memory.
    _held: Rc<gyre_client::Message<AnyMessage>>,
    address: usize,
    shape: Vec<usize>,
    strides: Vec<usize>,
    kind: &'static str,
}

#[pymethods]
impl View {
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let interface = PyDict::new(py);
        interface.set_item("version", 3)?;
        interface.set_item("data", (self.address, true))?;
        interface.set_item("shape", PyTuple::new(py, &self.shape)?)?;
        interface.set_item("strides", PyTuple::new(py, &self.strides)?)?;
        interface.set_item("typestr", self.kind)?;
        Ok(interface)
    }
}

impl View {
    fn new(
        held: &Rc<gyre_client::Message<AnyMessage>>,
        bytes: &[u8],
        kind: &'static str,
        [shape, strides]: [Vec<usize>; 2],
    ) -> Self {
        Self {
            _held: Rc::clone(held),
            address: bytes.as_ptr().addr(),
            shape,
            strides,
            kind,
        }
    }

    /// Views an array of numbers of a header.
    fn of(held: &Rc<gyre_client::Message<AnyMessage>>, value: &Value<'_>) -> Option<Self> {
        let Kind::Array(element, _) = value.kind else {
            return None;
        };
        let kind = type_string(element)?;
        let content = value.content();
        let shape = [vec![content.len() / element.bytes()], vec![element.bytes()]];
        Some(Self::new(held, content, kind, shape))
    }

    fn into_array(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        py.import("numpy")?
            .call_method1("asarray", (Py::new(py, self)?,))
    }
}

fn type_string(kind: &Kind) -> Option<&'static str> {
    Some(match kind {
        Kind::U8 => "|u1",
        Kind::U16 => "<u2",
        Kind::U32 => "<u4",
        Kind::U64 => "<u8",
        Kind::I64 => "<i8",
        Kind::F32 => "<f4",
        Kind::F64 => "<f8",
        Kind::Array(..) | Kind::Structure(_) => return None,
    })
}

/// Views a part of a payload; `None` for an unknown name.
fn payload(held: &Rc<gyre_client::Message<AnyMessage>>, topic: &Topic, name: &str) -> Option<View> {
    let received = held.received();
    let header = received.header_bytes();
    match (topic.name, name) {
        (<Scan as contract::Message>::TOPIC, "power") => {
            let scan: &ScanHeader = bytemuck::from_bytes(header);
            let (rows, bins) = (scan.azimuths as usize, scan.bins as usize);
            let bytes = received.values::<u8>().get(scan.first_byte as usize..)?;
            let shape = [vec![rows, bins], vec![scan.stride as usize, 1]];
            Some(View::new(held, bytes, "|u1", shape))
        }
        (<Masked as contract::Message>::TOPIC, "raster" | "points") => {
            let masked: &MaskedHeader = bytemuck::from_bytes(header);
            let values: &[f32] = received.values();
            if name == "points" {
                let points = masked.points(values)?;
                let row = size_of::<SparsePoint>();
                let shape = [vec![points.len(), row / 4], vec![row, 4]];
                return Some(View::new(held, bytemuck::cast_slice(points), "<f4", shape));
            }
            let n = masked.n as usize;
            let shape = [vec![n, n], vec![4 * n, 4]];
            Some(View::new(
                held,
                bytemuck::cast_slice(values.get(..n * n)?),
                "<f4",
                shape,
            ))
        }
        _ => None,
    }
}

/// Returns the 3 x 3 matrix of a packed covariance of (x, y, yaw).
fn matrix<'py>(py: Python<'py>, value: &Value<'_>) -> Bound<'py, PyAny> {
    let packed: covariance::Packed = bytemuck::pod_read_unaligned(value.content());
    numpy_arrays::matrix(py, &covariance::unpack(&packed)).into_any()
}

/// Copies a value: a number, a list, or a structure as a namespace.
fn object<'py>(py: Python<'py>, value: &Value<'_>) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value.number() {
        Some(Number::Whole(number)) => number.into_pyobject(py)?.into_any(),
        Some(Number::Signed(number)) => number.into_pyobject(py)?.into_any(),
        Some(Number::Single(number)) => number.into_pyobject(py)?.into_any(),
        Some(Number::Double(number)) => number.into_pyobject(py)?.into_any(),
        None => match value.kind {
            Kind::Structure(structure) => namespace(py, structure, value)?,
            _ => {
                let elements = value.elements().map(|it| object(py, &it));
                PyList::new(py, elements.collect::<PyResult<Vec<_>>>()?)?.into_any()
            }
        },
    })
}

fn namespace<'py>(
    py: Python<'py>,
    structure: &Structure,
    value: &Value<'_>,
) -> PyResult<Bound<'py, PyAny>> {
    let fields = PyDict::new(py);
    for (name, part) in value.fields() {
        let converted = match structure.field(name).map(|it| it.bounds) {
            Some(Bounds::Covariance) => matrix(py, &part),
            _ => object(py, &part)?,
        };
        fields.set_item(name, converted)?;
    }
    let types = py.import("types")?;
    types.getattr("SimpleNamespace")?.call((), Some(&fields))
}
