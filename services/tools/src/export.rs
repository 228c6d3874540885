//! `gyre export`: the results of a run, and its scans, as a bag of ROS 2; or the repaired recording
//! of a run, in RADIATE's format (`repaired`).

mod arguments;
mod repaired;
mod scans;
mod source;

use std::{path::Path, process::ExitCode};

use gyre_messages::ListedObject;
use gyre_recording::bags::{BagWriter, Kept, Topic};
use gyre_ros2_messages::{
    Mounting,
    frames::{self, Frames, Interval},
    nav_msgs::Odometry,
    objects,
    tf2_msgs::TFMessage,
    vision_msgs::Detection3DArray,
    visualization_msgs::MarkerArray,
};
use gyre_terminal::{Failure, print};

pub use arguments::{ExportArguments, FrameArguments, ScanForm};
use scans::ScanWriter;
use source::{Place, Source};

pub fn export(arguments: &ExportArguments) -> Result<ExitCode, Failure> {
    let mut source = Source::open(&arguments.source)?;
    match (&arguments.mcap, &arguments.out) {
        (Some(bag), _) => write_bag(&mut source, bag, arguments)?,
        (None, Some(out)) => repaired::write(&source, out)?,
        (None, None) => return Err("name what to write: --mcap BAG".into()),
    }
    Ok(ExitCode::SUCCESS)
}

fn write_bag(source: &mut Source, path: &Path, arguments: &ExportArguments) -> Result<(), Failure> {
    let mut bag = BagWriter::create(path)?;
    let frames = arguments.frames.frames.clone();
    let mounting = arguments.frames.mounting.parse()?;
    let mut places = source.places()?.peekable();
    let begin = |_: &_| Trajectory::begin(&mut bag, &frames, mounting);
    let mut trajectory = places.peek().map(begin).transpose()?;
    let mut scans = ScanWriter::begin(&mut bag, source, &arguments.scans, &frames.radar)?;
    let mut last_ns = 0;
    loop {
        let scan_ns = match &mut scans {
            Some(scans) => scans.write_next(&mut bag)?,
            None => None,
        };
        // After the last scan all the rest is due; what cannot be read is due at once.
        let is_due = |place: &Result<Place, Failure>| match (place, scan_ns) {
            (Ok(place), Some(scan_ns)) => place.stamp_ns <= scan_ns,
            _ => true,
        };
        while let Some(place) = places.next_if(is_due) {
            let place = place?;
            last_ns = last_ns.max(place.stamp_ns);
            if let Some(trajectory) = &mut trajectory {
                trajectory.write(&mut bag, &place)?;
            }
        }
        match scan_ns {
            Some(scan_ns) => last_ns = last_ns.max(scan_ns),
            None => break,
        }
    }
    source.write_map(&mut bag, &frames, last_ns, &mounting)?;
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

struct Trajectory {
    frames: Frames,
    mounting: Mounting,
    odometry: Topic<Odometry>,
    transforms: Topic<TFMessage>,
    fixed: Topic<TFMessage>,
    /// Of a run that tracks objects, from the first scan that has them.
    objects: Option<(Topic<Detection3DArray>, Topic<MarkerArray>)>,
    /// True if the mounting has been written.
    is_mounted: bool,
}

impl Trajectory {
    fn begin(bag: &mut BagWriter, frames: &Frames, mounting: Mounting) -> Result<Self, Failure> {
        Ok(Self {
            frames: frames.clone(),
            mounting,
            odometry: bag.topic("/odom", Kept::ForNobody)?,
            transforms: bag.topic("/tf", Kept::ForNobody)?,
            fixed: bag.topic("/tf_static", Kept::ForLater)?,
            objects: None,
            is_mounted: false,
        })
    }

    fn write(&mut self, bag: &mut BagWriter, place: &Place) -> Result<(), Failure> {
        let (frames, stamp_ns) = (&self.frames, place.stamp_ns);
        if !self.is_mounted {
            let radar = self.mounting.radar();
            let mounted = frames::transform(stamp_ns, &frames.base, &frames.radar, radar);
            let message = TFMessage {
                transforms: vec![mounted],
            };
            bag.write(&self.fixed, stamp_ns, &message)?;
            self.is_mounted = true;
        }
        let pose = self.mounting.of_vehicle_uncertain(&place.pose);
        let since = place.since.map(|since| Interval {
            motion: self.mounting.of_vehicle_uncertain(&since.motion),
            ..since
        });
        let odometry = frames::odometry(stamp_ns, frames, &pose, since.as_ref());
        let mut transforms = vec![frames::transform(
            stamp_ns,
            &frames.odom,
            &frames.base,
            &pose.motion,
        )];
        transforms.extend(place.map_from_odometry.map(|correction| {
            let correction = self.mounting.of_vehicle(&correction);
            frames::transform(stamp_ns, &frames.map, &frames.odom, &correction)
        }));
        bag.write(&self.odometry, stamp_ns, &odometry)?;
        bag.write(&self.transforms, stamp_ns, &TFMessage { transforms })?;
        match &place.objects {
            Some(objects) => self.write_objects(bag, stamp_ns, objects),
            None => Ok(()),
        }
    }

    fn write_objects(
        &mut self,
        bag: &mut BagWriter,
        stamp_ns: i64,
        listed: &[ListedObject],
    ) -> Result<(), Failure> {
        let (frames, mounting) = (&self.frames, &self.mounting);
        let (detections, markers) = match &mut self.objects {
            Some(topics) => topics,
            topics => topics.insert((
                bag.topic("/objects", Kept::ForNobody)?,
                bag.topic("/object_markers", Kept::ForNobody)?,
            )),
        };
        let detected = objects::detections(stamp_ns, frames, mounting, listed);
        bag.write(detections, stamp_ns, &detected)?;
        let drawn = objects::markers(stamp_ns, frames, mounting, listed);
        bag.write(markers, stamp_ns, &drawn)?;
        Ok(())
    }
}
