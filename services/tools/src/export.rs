//! `gyre export`: the results of a run, and its scans, as a bag of ROS 2; or the repaired recording
//! of a run, in RADIATE's format (`repaired`).

mod repaired;
mod scans;
mod source;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use gyre_configuration::terminal::{Failure, print};
use gyre_recording::bags::{BagWriter, Kept, Topic};
use gyre_ros2_messages::{
    Vehicle, frames::Frames, nav_msgs::Odometry, objects, tf2_msgs::TFMessage,
    vision_msgs::Detection3DArray, visualization_msgs::MarkerArray,
};

pub use repaired::write_grey;
use scans::ScanWriter;
use source::{Place, Source};

#[derive(Debug, Args)]
pub struct ExportArguments {
    /// The source: the folder of a run's results, a recording of a run, NAME.mcap, or a dataset.
    pub source: PathBuf,
    /// The bag to write: a folder, or one file if its name ends in .mcap.
    #[arg(long, value_name = "BAG", required_unless_present = "format")]
    pub mcap: Option<PathBuf>,
    /// Write the scans of a run in the form of its dataset instead, with each azimuth that was lost
    /// put back where the run has found it missing.
    #[arg(
        long,
        value_parser = ["radiate"],
        requires = "out",
        conflicts_with_all = ["mcap", "scans", "frames", "mounting"],
    )]
    pub format: Option<String>,
    /// The folder to write such a dataset to: a new or an empty one.
    #[arg(long, value_name = "FOLDER", requires = "format")]
    pub out: Option<PathBuf>,
    /// The form of the scans: as whole turns, azimuth by azimuth as the radar sends them, both, or
    /// not.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "b-scan")]
    pub scans: Vec<ScanForm>,
    #[command(flatten)]
    pub frames: FrameArguments,
}

#[derive(Debug, Args)]
pub struct FrameArguments {
    /// Names of the frames: of the map, of odometry, of the vehicle and of the radar.
    #[arg(
        long,
        value_name = "MAP,ODOM,BASE,RADAR",
        default_value = "map,odom,base_link,radar"
    )]
    pub frames: Frames,
    /// Where the radar is on the vehicle: m forward, m to the left, degrees counter-clockwise.
    #[arg(
        long,
        value_name = "X,Y,YAW",
        default_value = "0,0,0",
        allow_hyphen_values = true
    )]
    pub mounting: String,
}

impl FrameArguments {
    pub fn vehicle(&self) -> Result<Vehicle, String> {
        Ok(Vehicle {
            frames: self.frames.clone(),
            mounting: self.mounting.parse()?,
        })
    }
}

/// The form of the scans in the bag.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ScanForm {
    /// A message a turn: navtech_msgs/msg/RadarBScanMsg.
    BScan,
    /// A message an azimuth: navtech_msgs/msg/RadarFftDataMsg.
    Fft,
    /// No scans.
    None,
}

pub fn export(arguments: &ExportArguments) -> Result<(), Failure> {
    let mut source = Source::open(&arguments.source)?;
    match (&arguments.mcap, &arguments.out) {
        (Some(bag), _) => write_bag(&mut source, bag, arguments),
        (None, Some(out)) => repaired::write(&source, out),
        (None, None) => Err("name what to write: --mcap BAG".into()),
    }
}

fn write_bag(source: &mut Source, path: &Path, arguments: &ExportArguments) -> Result<(), Failure> {
    let mut bag = BagWriter::create(path)?;
    let vehicle = &arguments.frames.vehicle()?;
    let mut places = source.places()?.peekable();
    let begin = |_: &_| Trajectory::begin(&mut bag, vehicle);
    let mut trajectory = places.peek().map(begin).transpose()?;
    let frame = &vehicle.frames.radar;
    let mut scans = ScanWriter::begin(&mut bag, source, &arguments.scans, frame)?;
    let mut last_ns = 0;
    loop {
        let scan_ns = match &mut scans {
            Some(scans) => scans.write_next(&mut bag)?,
            None => None,
        };
        // After the last scan all the rest is due; what cannot be read is due at once.
        let is_due = |place: &Result<Place, Failure>| match (place, scan_ns) {
            (Ok(place), Some(scan_ns)) => place.stamp_ns() <= scan_ns,
            _ => true,
        };
        while let Some(place) = places.next_if(is_due) {
            let place = place?;
            last_ns = last_ns.max(place.stamp_ns());
            if let Some(trajectory) = &mut trajectory {
                trajectory.write(&mut bag, &place)?;
            }
        }
        match scan_ns {
            Some(scan_ns) => last_ns = last_ns.max(scan_ns),
            None => break,
        }
    }
    source.write_map(&mut bag, last_ns, vehicle)?;
    let counts = bag
        .counts()
        .map(|(topic, count)| format!("{topic} {count}"));
    let counts: Vec<String> = counts.collect();
    if bag.counts().all(|(_, count)| count == 0) {
        let source = arguments.source.display();
        return Err(format!("{source} has nothing to export: neither poses nor scans").into());
    }
    bag.finish()?;
    print::line(format_args!("{}: {}", path.display(), counts.join(", ")))?;
    scans.iter().for_each(ScanWriter::describe_losses);
    Ok(())
}

struct Trajectory<'a> {
    vehicle: &'a Vehicle,
    odometry: Topic<Odometry>,
    transforms: Topic<TFMessage>,
    /// The topic of the mounting, until the first pose.
    fixed: Option<Topic<TFMessage>>,
    /// Of a run that tracks objects, from the first scan that has them.
    objects: Option<(Topic<Detection3DArray>, Topic<MarkerArray>)>,
}

impl<'a> Trajectory<'a> {
    fn begin(bag: &mut BagWriter, vehicle: &'a Vehicle) -> Result<Self, Failure> {
        Ok(Self {
            vehicle,
            odometry: bag.topic("/odom", Kept::ForNobody)?,
            transforms: bag.topic("/tf", Kept::ForNobody)?,
            fixed: Some(bag.topic("/tf_static", Kept::ForLater)?),
            objects: None,
        })
    }

    fn write(&mut self, bag: &mut BagWriter, place: &Place) -> Result<(), Failure> {
        let (vehicle, stamp_ns) = (self.vehicle, place.stamp_ns());
        if let Some(fixed) = self.fixed.take() {
            bag.write(&fixed, stamp_ns, &vehicle.mounted(stamp_ns))?;
        }
        let corrected = place.map_from_odometry.as_ref();
        let transforms = vehicle.transforms(stamp_ns, &place.pose, corrected, 0);
        let odometry = vehicle.odometry(stamp_ns, &place.pose);
        bag.write(&self.odometry, stamp_ns, &odometry)?;
        bag.write(&self.transforms, stamp_ns, &transforms)?;
        let Some(listed) = &place.objects else {
            return Ok(());
        };
        let (detections, markers) = match &mut self.objects {
            Some(topics) => topics,
            topics => topics.insert((
                bag.topic("/objects", Kept::ForNobody)?,
                bag.topic("/object_markers", Kept::ForNobody)?,
            )),
        };
        let detected = objects::detections(stamp_ns, vehicle, listed);
        bag.write(detections, stamp_ns, &detected)?;
        let drawn = objects::markers(stamp_ns, vehicle, listed);
        bag.write(markers, stamp_ns, &drawn)?;
        Ok(())
    }
}
