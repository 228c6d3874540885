//! Messages that a foreign stage may send: the next stages receive any header and any payload.

use std::sync::{Mutex, PoisonError};

use bolero::{TypeGenerator, check};
use gyre_contract::{
    MaskedHeader, MotionEstimate, MotionHeader, PoseHeader, RotationEstimate, ScanHeader, compose,
};
use gyre_fuzz::{Failure, Target, edit::Number};
use gyre_geometry::{SparsePoint, samples::SensorConfigs};
use gyre_masking::{MaskKind, Masker, MaskingConfig, Sweep};
use gyre_matching::{
    ExhaustiveConfig, ExhaustiveSearch, MotionMatch, RefinementConfig, Refiner, RotationConfig,
    Searched, SequentialRotation, TranslationConfig, TranslationSearch,
};
use gyre_radar::{PointsConfig, RasterConfig};
use gyre_stages::estimates;
use ndarray::Array2;

const N: usize = 31;
const CELL_M: f32 = 2.0;
const POINTS: usize = 64;

fn raster() -> RasterConfig {
    RasterConfig {
        n: N,
        cell_m: CELL_M,
        ..RasterConfig::default()
    }
}

fn points() -> PointsConfig {
    PointsConfig {
        capacity: POINTS,
        ..PointsConfig::default()
    }
}

#[derive(Clone, Debug, TypeGenerator)]
struct ScanMessage {
    /// Azimuths, bins, stride, first byte; and what replaces them.
    counts: [u16; 4],
    wild: [Option<u32>; 4],
    /// Resolution, offset, Doppler shift.
    floats: [Option<Number>; 3],
    azimuth: Vec<(u8, Number)>,
    stamp: Vec<(u8, Number)>,
    bytes: u16,
    /// Velocity of the motion compensation.
    twist: Option<[Number; 3]>,
}

impl ScanMessage {
    fn header(&self) -> ScanHeader {
        let mut header = ScanHeader {
            range_resolution_m: 0.5,
            clockwise: 1,
            ..ScanHeader::default()
        };
        let small = |k: usize| u32::from(self.counts[k] % [33, 65, 80, 16][k]);
        let count = |k: usize| self.wild[k].unwrap_or(small(k));
        (header.azimuths, header.bins) = (count(0), count(1));
        (header.stride, header.first_byte) = (count(2), count(3));
        header.azimuth_rad = std::array::from_fn(|row| row as f32 * 0.2);
        header.azimuth_stamp_ns = std::array::from_fn(|row| row as i64 * 10_000_000);
        let floats = [
            &mut header.range_resolution_m,
            &mut header.range_offset_m,
            &mut header.doppler_s,
        ];
        for (float, number) in floats.into_iter().zip(self.floats) {
            *float = number.map_or(*float, |number| number.f64() as f32);
        }
        for (row, number) in &self.azimuth {
            header.azimuth_rad[usize::from(*row)] = number.f64() as f32;
        }
        for (row, number) in &self.stamp {
            header.azimuth_stamp_ns[usize::from(*row)] = number.bits() as i64;
        }
        header
    }
}

#[test]
fn scans() {
    let target = Target::new(64);
    let masker = |undo_doppler| {
        let config = MaskingConfig {
            kind: MaskKind::Threshold,
            undo_doppler,
            ..MaskingConfig::default()
        };
        Masker::new(&raster(), &points(), &config).unwrap()
    };
    check!()
        .with_type::<(bool, ScanMessage)>()
        .for_each(|(undo_doppler, message)| {
            let (header, mut masker) = (message.header(), masker(*undo_doppler));
            let bytes: Vec<u8> = (0..message.bytes % 4096)
                .map(|k| k.wrapping_mul(37) as u8)
                .collect();
            target.run(|| -> Result<(), Failure> {
                let scan = header
                    .view(&bytes)
                    .ok_or("its payload is shorter than its header says")?;
                let twist = message.twist.map(|numbers| {
                    let [vx_mps, vy_mps, yaw_rate_radps] = numbers.map(Number::f64);
                    gyre_geometry::Twist {
                        vx_mps,
                        vy_mps,
                        yaw_rate_radps,
                    }
                });
                let sweep = Sweep {
                    number: 1,
                    scan,
                    twist,
                };
                let (mut out, mut found) =
                    (Array2::zeros((N, N)), vec![SparsePoint::default(); POINTS]);
                let twist = masker.mask(&sweep, None, out.view_mut(), None)?;
                assert!(out.iter().all(|cell| cell.is_finite()), "{sweep:?}");
                let count = masker.points(&scan, twist, &mut found)?;
                assert!(found[..count].iter().all(|point| point.weight.is_finite()));
                Ok(())
            });
        });
}

#[derive(Clone, Debug, TypeGenerator)]
struct MaskedMessage {
    n: Option<u32>,
    rasters: u8,
    points: u8,
    wild_points: Option<u32>,
    values: Vec<(u16, Number)>,
    blocks: u8,
}

impl MaskedMessage {
    fn header(&self) -> MaskedHeader {
        MaskedHeader {
            n: self.n.unwrap_or(N as u32),
            rasters: u32::from(self.rasters % 4),
            points: self.wild_points.unwrap_or(u32::from(self.points % 40)),
            cell_m: CELL_M,
            ..MaskedHeader::default()
        }
    }

    fn values(&self) -> Vec<f32> {
        let len = 16 * (64 * usize::from(self.blocks % 5) + usize::from(self.blocks));
        let mut values: Vec<f32> = (0..len).map(|k| (k * 31 % 97) as f32).collect();
        for (at, number) in &self.values {
            if let Some(value) = values.get_mut(usize::from(*at) % len.max(1)) {
                *value = number.f64() as f32;
            }
        }
        values
    }
}

fn rotation(numbers: [Number; 5]) -> RotationEstimate {
    let numbers = numbers.map(Number::f64);
    RotationEstimate {
        angle_rad: numbers[0],
        variance_rad2: numbers[1],
        score: numbers[2],
        runner_up_rad: numbers[3],
        runner_up_score: numbers[4],
    }
}

/// For any cells, the results of the searches are finite.
fn assert_finite(angle: &RotationEstimate, motion: &MotionMatch) {
    let turn = [angle.angle_rad, angle.variance_rad2, angle.score];
    let way = [motion.x_m, motion.y_m, motion.yaw_rad, motion.score];
    let mut all = turn.iter().chain(&way).chain(motion.covariance.iter());
    assert!(all.all(|it| it.is_finite()), "{angle:?}, {motion:?}");
}

#[test]
fn masked_rasters() {
    let target = Target::new(64);
    let mut rotations = SequentialRotation::new(N, &RotationConfig::default()).unwrap();
    let translations = TranslationConfig {
        reach_m: 8.0,
        ..TranslationConfig::default()
    };
    let mut translation = TranslationSearch::new(N, CELL_M.into(), &translations).unwrap();
    let exhaustive = ExhaustiveConfig {
        reach_m: 8.0,
        ..ExhaustiveConfig::default()
    };
    let mut joint = ExhaustiveSearch::new(N, CELL_M.into(), &exhaustive).unwrap();
    let searches = Mutex::new((&mut rotations, &mut translation, &mut joint));
    check!()
        .with_type::<(u64, [MaskedMessage; 2], Option<[Number; 5]>)>()
        .for_each(|(seq, [now, then], angle)| {
            let mut searches = searches.lock().unwrap_or_else(PoisonError::into_inner);
            let (rotations, translation, joint) = &mut *searches;
            let (header, values, earlier, earlier_values) =
                (now.header(), now.values(), then.header(), then.values());
            target.run(|| -> Result<(), Failure> {
                let pair = header.pair(&values, Some((&earlier, &earlier_values)));
                let pair = pair.ok_or("its rasters do not fit their headers")?;
                let found =
                    rotations.next(*seq, pair.later, pair.earlier, pair.earlier_changed, None)?;
                let estimate = found.as_ref().map(estimates::rotation);
                let estimate = estimate.unwrap_or_default();
                let angle = angle.map_or(estimate, rotation);
                if let Some(earlier) = pair.earlier {
                    let by_halves = translation.search(
                        pair.later,
                        earlier,
                        &estimates::rotation_match(&estimate),
                    )?;
                    translation.search(pair.later, earlier, &estimates::rotation_match(&angle))?;
                    let jointly = joint.search(pair.later, earlier)?;
                    assert_finite(&estimate, &by_halves);
                    assert_finite(&estimates::rotation(&jointly.rotation), &jointly.motion);
                }
                Ok(())
            });
        });
}

fn motion(numbers: &[Number], interval_ns: i64) -> MotionHeader {
    let number = |k: usize| numbers.get(k).map_or(0.1, |number| number.f64());
    MotionHeader {
        motion: MotionEstimate {
            x_m: number(0),
            y_m: number(1),
            yaw_rad: number(2),
            covariance: std::array::from_fn(|k| number(3 + k)),
            searched: std::array::from_fn(|k| number(9 + k)),
            interval_ns,
            ..MotionEstimate::default()
        },
        ..MotionHeader::default()
    }
}

#[test]
fn motions_and_points() {
    let target = Target::new(96);
    let config = RefinementConfig {
        keyframes: 3,
        ..RefinementConfig::default()
    };
    let refiner = Mutex::new(Refiner::new(&config, &SensorConfigs::default(), POINTS).unwrap());
    check!()
        .with_type::<([MaskedMessage; 2], Vec<Number>, Number, bool)>()
        .for_each(|([now, then], numbers, interval, reset)| {
            let mut refiner = refiner.lock().unwrap_or_else(PoisonError::into_inner);
            let header = motion(numbers, interval.bits() as i64);
            let (later, later_values, earlier, earlier_values) =
                (now.header(), now.values(), then.header(), then.values());
            target.run(|| -> Result<(), Failure> {
                let fit = "its points do not fit its header";
                let (later, earlier) = (
                    later.points(&later_values).ok_or(fit)?,
                    earlier.points(&earlier_values).ok_or(fit)?,
                );
                if *reset {
                    refiner.reset();
                }
                let interval_s = header.motion.interval_ns as f64 * 1e-9;
                let motion = header.motion.motion().motion;
                let refined =
                    refiner.refine(&Searched::by_radar(1, later, earlier, &motion, interval_s));
                let refined = MotionHeader {
                    motion: estimates::refined(&header.motion, &refined),
                    ..header
                };
                let pose = compose(Some(&PoseHeader::default()), &refined);
                compose(Some(&pose), &header);
                header.motion.searched_twist();
                Ok(())
            });
        });
}
