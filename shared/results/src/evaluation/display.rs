//! Evaluations as text.

use std::fmt;

use crate::evaluation::{
    Coverage, EndError, Evaluation, Kitti, Nees, NeesFigures, NeesLength, Rpe, Seg, TruthSigma,
};

impl fmt::Display for Evaluation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "association   {}", self.coverage)?;
        writeln!(f, "axes          {}", self.axes)?;
        if let Some(degrees) = self.heading_offset_deg {
            writeln!(
                f,
                "{:14}the heading of the estimate differs by {degrees:.1} deg throughout, as of a sensor that is mounted otherwise: \
                 KITTI, end point and RPE do not hold",
                ""
            )?;
        }
        let (path_m, estimated_m) = (self.path_m, self.estimated_path_m);
        write!(
            f,
            "path length   {path_m:.2} m, estimate {estimated_m:.2} m"
        )?;
        writeln!(f, "{}", if self.truth_stands { STANDS } else { "" })?;
        match &self.kitti {
            Some(kitti) => writeln!(f, "KITTI         {kitti}")?,
            None => writeln!(f, "KITTI         none: {}", self.why_no_kitti())?,
        }
        match &self.seg {
            Some(seg) => writeln!(f, "seg           {seg}")?,
            None => writeln!(f, "seg           none: {TOO_SHORT}")?,
        }
        let (rmse, mean, max) = (self.ate.rmse_m, self.ate.mean_m, self.ate.max_m);
        write!(
            f,
            "ATE           {rmse:.3} m rmse, {mean:.3} m mean, {max:.3} m max, "
        )?;
        writeln!(f, "after SE(2) alignment")?;
        if let Some(end) = &self.end {
            writeln!(f, "end point     {end}")?;
        }
        match &self.rpe {
            Some(rpe) => write!(f, "RPE           {rpe}")?,
            None => {
                let why = self.axes.without_heading().unwrap_or_default();
                write!(f, "RPE           none: {why}")?;
            }
        }
        match f.alternate() {
            true => self.fmt_lengths(f),
            false => Ok(()),
        }
    }
}

const STANDS: &str = "; the ground truth stands still: is it of this drive?";
const TOO_SHORT: &str = "the path is not longer than 100 m";

impl Evaluation {
    fn why_no_kitti(&self) -> String {
        match self.axes.without_heading() {
            Some(why) => format!("{why}; use ATE and seg"),
            None => format!("{TOO_SHORT}; use RPE"),
        }
    }

    fn fmt_lengths(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(seg) = &self.seg else { return Ok(()) };
        write!(f, "\n\n  length  segments  translation    rotation     seg")?;
        write!(f, "\n       m                        %   deg/100 m       %")?;
        for (k, length) in seg.by_length.iter().enumerate() {
            write!(f, "\n{:8.0} {:10}", length.length_m, length.segments)?;
            match self.kitti.as_ref().and_then(|kitti| kitti.by_length.get(k)) {
                Some(kitti) => {
                    write!(f, " {:12.4}", kitti.translation_percent)?;
                    write!(f, " {:11.4}", kitti.rotation_deg_per_100m)?;
                }
                None => write!(f, " {:>12} {:>11}", "-", "-")?,
            }
            write!(f, " {:7.4}", length.percent)?;
        }
        Ok(())
    }
}

impl fmt::Display for Coverage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Coverage::Time {
                matched,
                outside_span,
                in_gaps,
                max_gap_ns,
            } => write!(
                f,
                "by time: {matched} of {} estimated poses; left out: {outside_span} outside the span of the ground truth, \
                 {in_gaps} in its gaps above {} s",
                matched + outside_span + in_gaps,
                (max_gap_ns as f64 * 1e-7).round() / 100.0
            ),
            Coverage::Index {
                matched,
                estimate_surplus,
                truth_surplus,
            } => write!(
                f,
                "by index: {matched} of {} estimated poses; left out: {estimate_surplus} at its end, \
                 {truth_surplus} at the end of the ground truth",
                matched + estimate_surplus
            ),
        }
    }
}

impl fmt::Display for Kitti {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.5} % translation, ", self.translation_percent)?;
        let (per_100m, per_km) = (self.rotation_deg_per_100m, self.rotation_deg_per_km);
        write!(f, "{per_100m:.5} deg/100 m ({per_km:.4} deg/km) rotation; ")?;
        write!(f, "{} segments, step {}", self.segments, self.step)
    }
}

impl fmt::Display for Seg {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.4} % of the length; rmse after SE(2) ", self.percent)?;
        write!(f, "alignment of each segment")
    }
}

impl fmt::Display for EndError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} m", self.position_m)?;
        if let Some(percent) = self.percent {
            write!(f, ", {percent:.2} % of the path")?;
        }
        let heading_deg = self.heading_deg;
        write!(f, ", heading {heading_deg:.2} deg; first poses aligned")
    }
}

impl fmt::Display for Rpe {
    /// Writes two lines, the second indented as the rows of an evaluation are.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (rmse, mean) = (self.translation_rmse_m, self.translation_mean_m);
        write!(f, "translation {rmse:.4} m rmse, {mean:.4} m mean")?;
        if let Some(ratio) = self.forward_ratio {
            write!(f, "; forward distance {ratio:.4} of the true one")?;
        }
        let (rmse, mean) = (self.rotation_rmse_deg, self.rotation_mean_deg);
        write!(
            f,
            "\n{:14}rotation {rmse:.4} deg rmse, {mean:.4} deg mean",
            ""
        )?;
        write!(f, "; {} pairs", self.pairs.len())
    }
}

impl fmt::Display for Nees {
    /// Writes a table of all segments; the alternate form has lines for each half of the drive,
    /// too.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (motions, without_truth) = (self.motions, self.without_truth);
        let (without_covariance, sigma) = (self.without_covariance, self.truth_sigma);
        write!(
            f,
            "covariance    {motions} motions; left out: {without_truth} without ground truth, \
             {without_covariance} without covariance; ground truth {sigma}\n\
             {0:14}mean NEES over its degrees of freedom (1: consistent, above: overconfident)\n\
             {0:14}[95 % acceptance interval of independent errors]  share outside the 95 % region\n\
             \n motions      half   segments            pose                     translation                      yaw",
            ""
        )?;
        self.by_length.iter().try_for_each(|length| length.fmt(f))?;
        let lengths = self.by_length.iter();
        let factors = lengths.map(|length| format!("{:.2}", length.all.pose.ratio.sqrt()));
        let factors = factors.collect::<Vec<_>>().join(", ");
        write!(f, "\n\n{:14}poses err {factors} times as much ", "")?;
        write!(f, "as their covariances state")
    }
}

impl fmt::Display for NeesLength {
    /// Writes lines that begin with a line break: all segments, and in the alternate form each
    /// half.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\n{:8}{:>10}{}", self.motions, "all", self.all)?;
        for (half, figures) in [("first", &self.first_half), ("second", &self.second_half)] {
            if let Some(figures) = figures.as_ref().filter(|_| f.alternate()) {
                write!(f, "\n{:8}{half:>10}{figures}", self.motions)?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for TruthSigma {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self == Self::default() {
            true => write!(f, "exact"),
            false => {
                let (position_m, yaw_deg) = (self.position_m, self.yaw_rad.to_degrees());
                write!(f, "sigma {position_m} m, {yaw_deg:.3} deg")
            }
        }
    }
}

impl fmt::Display for NeesFigures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:11}", self.segments)?;
        for figure in [self.pose, self.translation, self.yaw] {
            let ([low, high], outside) = (figure.acceptance_interval, figure.outside_percent);
            write!(
                f,
                "{:8.2} [{low:.2}, {high:.2}]{outside:6.1} %",
                figure.ratio
            )?;
        }
        Ok(())
    }
}
