//! The arguments after `--ros-args`, as launch files of ROS 2 pass them: the name and the namespace
//! of the node, and parameters as kiss-icp names them.

use gyre_ros2_messages::frames::Frames;

const KNOWN: &str = "known are -r __node:=NAME, -r __ns:=NAMESPACE, and -p with base_frame, lidar_odom_frame, map_frame, radar_frame or publish_odom_tf, as in -p base_frame:=base_link";

#[derive(Debug, Default, PartialEq)]
pub struct RosArguments {
    pub node: Option<String>,
    pub namespace: Option<String>,
    pub publish_odom_tf: Option<bool>,
    frames: Vec<(Frame, String)>,
}

type Frame = fn(&mut Frames) -> &mut String;

const FRAMES: [(&str, Frame); 4] = [
    ("base_frame", |it| &mut it.base),
    ("lidar_odom_frame", |it| &mut it.odom),
    ("map_frame", |it| &mut it.map),
    ("radar_frame", |it| &mut it.radar),
];

impl RosArguments {
    pub fn parse(words: &[String]) -> Result<Self, String> {
        let mut found = Self::default();
        // Launch files may write it twice.
        let mut words = words.iter().filter(|word| *word != "--ros-args");
        while let Some(option) = words.next() {
            let value = words.next().and_then(|value| value.split_once(":="));
            let is_known = match (option.as_str(), value) {
                ("-r" | "--remap", Some((name, value))) => found.rename_node(name, value),
                ("-p" | "--param", Some((name, value))) => found.set(name, value),
                _ => false,
            };
            if !is_known {
                let value = value.map(|(name, value)| format!(" {name}:={value}"));
                let value = value.unwrap_or_default();
                return Err(format!("{option}{value} of --ros-args is unknown: {KNOWN}"));
            }
        }
        Ok(found)
    }

    fn rename_node(&mut self, name: &str, value: &str) -> bool {
        let renamed = match name {
            "__node" => &mut self.node,
            "__ns" => &mut self.namespace,
            _ => return false,
        };
        *renamed = Some(value.to_owned());
        true
    }

    fn set(&mut self, name: &str, value: &str) -> bool {
        if name == "publish_odom_tf" {
            self.publish_odom_tf = value.to_lowercase().parse().ok();
            return self.publish_odom_tf.is_some();
        }
        let frame = FRAMES.iter().find(|(known, _)| *known == name);
        let is_name = !value.is_empty() && !value.starts_with('/');
        let frame = frame.filter(|_| is_name);
        let renamed = frame.map(|(_, frame)| (*frame, value.to_owned()));
        self.frames.extend(renamed);
        frame.is_some()
    }

    /// Gives the frames the names of the parameters.
    pub fn rename(&self, frames: &mut Frames) {
        for (frame, name) in &self.frames {
            frame(frames).clone_from(name);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<RosArguments, String> {
        let words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        RosArguments::parse(&words)
    }

    #[test]
    fn launch_files_name_the_node_and_the_frames() {
        let found = parse(
            "-r __node:=radar -r __ns:=/car --ros-args -p base_frame:=car/base -p publish_odom_tf:=False",
        );
        let found = found.unwrap();
        let names = (found.node.as_deref(), found.namespace.as_deref());
        assert_eq!(names, (Some("radar"), Some("/car")));
        assert_eq!(found.publish_odom_tf, Some(false));
        let mut frames: Frames = "map,odom,base_link,radar".parse().unwrap();
        found.rename(&mut frames);
        assert_eq!((&*frames.base, &*frames.odom), ("car/base", "odom"));
    }

    #[test]
    fn what_is_unknown_is_refused() {
        for line in [
            "--params-file a.yaml",
            "-r odom:=/odometry",
            "-p use_sim_time:=true",
            "-p base_frame:=/base",
            "-p publish_odom_tf:=perhaps",
            "-r",
        ] {
            let refused = parse(line).unwrap_err();
            assert!(refused.contains("is unknown: known are"), "{refused}");
        }
    }
}
