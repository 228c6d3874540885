use std::{f64::consts::PI, sync::Arc};

use gyre_geometry::wrap_angle;
use gyre_matching::{Peak, line_peak};
use gyre_radar::fourier::{Complex32, ComplexToReal};
use gyre_simd::simd;

use super::descriptor::{Descriptor, HARMONICS, SPECTRUM_BYTES};

/// Places that are ranked by their whole descriptors.
const SHORTLIST: usize = 32;
/// Samples of the correlation over half a turn.
const ANGLES: usize = 4 * HARMONICS;
/// Angles of a place that are ranked, at most.
const MAX_ANGLES: usize = 8;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// The place, counted from 0 in the order of insertion.
    pub place: usize,
    /// Correlation coefficient of the descriptors at the best angle.
    pub score: f64,
    /// Yaw of the queried place in the found one's frame, in (-pi/2, pi/2] rad: descriptors are
    /// ambiguous by half a turn.
    pub yaw_rad: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "a place at {path_m} m of the path cannot follow one at {last_m} m: places are added in the order of the path"
)]
pub struct OrderError {
    pub path_m: f64,
    pub last_m: f64,
}

/// The descriptors of all places, in the order of the path.
pub struct PlaceIndex {
    /// The id and the path of each place.
    pub(super) places: Vec<(u64, f64)>,
    pub(super) sieves: Vec<u8>,
    pub(super) spectra: Vec<i8>,
    norms: Vec<f32>,
    query: Query,
}

struct Query {
    distances: Vec<(u32, u32)>,
    inverse: Arc<dyn ComplexToReal<f32>>,
    cross: Vec<Complex32>,
    correlation: Vec<f32>,
    scratch: Vec<Complex32>,
    found: Vec<Candidate>,
}

impl Default for PlaceIndex {
    fn default() -> Self {
        Self::with_capacity(0)
    }
}

impl PlaceIndex {
    /// Creates an empty index with memory for a number of places. More places make it grow.
    pub fn with_capacity(places: usize) -> Self {
        Self {
            places: Vec::with_capacity(places),
            sieves: Vec::with_capacity(places * Descriptor::SIEVE_BYTES),
            spectra: Vec::with_capacity(places * SPECTRUM_BYTES),
            norms: Vec::with_capacity(places),
            query: Query::new(places),
        }
    }

    /// Adds a place, `path_m` metres along the path. Returns its number.
    /// On an error the index is unchanged.
    pub fn insert(
        &mut self,
        id: u64,
        path_m: f64,
        descriptor: &Descriptor,
    ) -> Result<usize, OrderError> {
        let last_m = self.places.last().map_or(0.0, |(_, last_m)| *last_m);
        if !(path_m.is_finite() && path_m >= last_m) {
            return Err(OrderError { path_m, last_m });
        }
        self.places.push((id, path_m));
        self.sieves.extend_from_slice(&descriptor.sieve);
        self.spectra.extend_from_slice(&descriptor.spectrum);
        self.norms.push(norm(&descriptor.spectrum));
        Ok(self.places.len() - 1)
    }

    pub fn len(&self) -> usize {
        self.places.len()
    }

    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    pub fn descriptor(&self, place: usize) -> Option<Descriptor> {
        let (sieves, spectra) = (Descriptor::SIEVE_BYTES, SPECTRUM_BYTES);
        (place < self.len()).then(|| Descriptor {
            sieve: self.sieves[place * sieves..][..sieves].to_vec(),
            spectrum: self.spectra[place * spectra..][..spectra].to_vec(),
        })
    }

    pub fn places_until(&self, path_m: f64) -> usize {
        self.places
            .partition_point(|(_, place_m)| *place_m <= path_m)
    }

    /// Finds the places among the first `eligible` ones that look most similar: at most 32, the
    /// best first. Places less than `apart_m` along the path from a better one are left out.
    pub fn query(
        &mut self,
        descriptor: &Descriptor,
        eligible: usize,
        apart_m: f64,
    ) -> &[Candidate] {
        let eligible = eligible.min(self.len());
        let sieves = &self.sieves[..eligible * Descriptor::SIEVE_BYTES];
        self.query.sift(&descriptor.sieve, sieves);
        self.query
            .rank(&descriptor.spectrum, &self.spectra, &self.norms, 1);
        let path_m = |candidate: &Candidate| self.places[candidate.place].1;
        keep_apart(&mut self.query.found, |a, b| {
            (path_m(a) - path_m(b)).abs() >= apart_m
        });
        &self.query.found
    }

    /// Ranks all places by their whole descriptors, the best first, each at the best `angles`
    /// angles: for a query that must not miss its place, such as a scan that is half hidden. It
    /// takes some microseconds a place.
    pub fn rank_all(&mut self, descriptor: &Descriptor, angles: usize) -> &[Candidate] {
        let places = 0..self.places.len() as u32;
        self.query.distances.clear();
        self.query.distances.extend(places.map(|place| (0, place)));
        self.query.rank(
            &descriptor.spectrum,
            &self.spectra,
            &self.norms,
            angles.min(MAX_ANGLES),
        );
        &self.query.found
    }
}

impl Query {
    fn new(places: usize) -> Self {
        let inverse = gyre_radar::fourier::real_inverse(ANGLES);
        Self {
            distances: Vec::with_capacity(places),
            cross: inverse.make_input_vec(),
            correlation: inverse.make_output_vec(),
            scratch: inverse.make_scratch_vec(),
            inverse,
            found: Vec::with_capacity(SHORTLIST),
        }
    }

    /// Keeps the places that are nearest in the sieve, of equal ones the earlier.
    fn sift(&mut self, sieve: &[u8], sieves: &[u8]) {
        self.distances.clear();
        self.distances.extend(
            sieves
                .chunks_exact(Descriptor::SIEVE_BYTES)
                .zip(0..)
                .map(|(other, place)| (distance(sieve, other), place)),
        );
        if self.distances.len() > SHORTLIST {
            self.distances.select_nth_unstable(SHORTLIST);
            self.distances.truncate(SHORTLIST);
        }
    }

    /// Ranks them by the correlation of the whole descriptors, of equal ones the earlier first.
    fn rank(&mut self, spectrum: &[i8], spectra: &[i8], norms: &[f32], angles: usize) {
        self.found.clear();
        let own = norm(spectrum);
        for k in 0..self.distances.len() {
            let place = self.distances[k].1 as usize;
            let other = &spectra[place * SPECTRUM_BYTES..][..SPECTRUM_BYTES];
            self.correlate(spectrum, other);
            let mut peaks = [0; MAX_ANGLES];
            for &peak in self.highest(&mut peaks[..angles]) {
                let (score, yaw_rad) = self.refined(peak, own * norms[place]);
                self.found.push(Candidate {
                    place,
                    score,
                    yaw_rad,
                });
            }
        }
        self.found
            .sort_unstable_by(|a, b| b.score.total_cmp(&a.score).then(a.place.cmp(&b.place)));
    }

    /// The correlation over the angle (Weston et al., Eq. 7).
    fn correlate(&mut self, later: &[i8], earlier: &[i8]) {
        let cross = cross_spectrum(later, earlier);
        self.cross.fill(Complex32::default());
        let (re, im) = cross.split_at(HARMONICS);
        for ((z, re), im) in self.cross[1..].iter_mut().zip(re).zip(im) {
            *z = Complex32::new(*re as f32, *im as f32);
        }
        let done = self.inverse.process_with_scratch(
            &mut self.cross,
            &mut self.correlation,
            &mut self.scratch,
        );
        debug_assert!(done.is_ok(), "lengths are those of the plan");
    }

    fn at(&self, k: isize) -> f64 {
        f64::from(self.correlation[k.rem_euclid(ANGLES as isize) as usize])
    }

    /// Fills in the samples of the highest local maxima, the highest first, of equal ones the
    /// earlier; returns those that there are. A flat correlation has its maximum at the first
    /// sample.
    fn highest<'a>(&self, peaks: &'a mut [isize]) -> &'a [isize] {
        let mut count = 0;
        let is_peak = |k: &isize| self.at(*k) > self.at(k - 1) && self.at(*k) >= self.at(k + 1);
        for k in (0..ANGLES as isize).filter(is_peak) {
            let place = peaks[..count].partition_point(|&higher| self.at(higher) >= self.at(k));
            if place < peaks.len() {
                count = (count + 1).min(peaks.len());
                peaks[place..count].rotate_right(1);
                peaks[place] = k;
            }
        }
        &peaks[..count.max(1).min(peaks.len())]
    }

    /// The correlation coefficient at a local maximum between the samples, and its angle.
    fn refined(&self, sample: isize, energy: f32) -> (f64, f64) {
        let peak = line_peak(Peak::Parabola, |k| self.at(sample + k));
        // Each harmonic stands for its mirror image too.
        let score = peak.value / (2.0 * f64::from(energy).max(1.0));
        // Doubled, the half turn is a whole one.
        let doubled = wrap_angle((sample as f64 + peak.offset) * 2.0 * PI / ANGLES as f64);
        (score, 0.5 * doubled)
    }
}

/// Removes each candidate for which `apart` does not hold with a better one that stays.
fn keep_apart(found: &mut Vec<Candidate>, apart: impl Fn(&Candidate, &Candidate) -> bool) {
    let mut kept = 0;
    for k in 0..found.len() {
        if found[..kept].iter().all(|better| apart(better, &found[k])) {
            found[kept] = found[k];
            kept += 1;
        }
    }
    found.truncate(kept);
}

#[simd]
fn distance(a: &[u8], b: &[u8]) -> u32 {
    a.iter()
        .zip(b)
        .map(|(a, b)| u32::from(a.abs_diff(*b)))
        .sum()
}

fn norm(spectrum: &[i8]) -> f32 {
    let energy: i32 = spectrum.iter().map(|v| i32::from(*v).pow(2)).sum();
    (energy as f32).sqrt()
}

/// The sum over radii of G conj(F), with F the later and G the earlier spectrum: real parts of all
/// harmonics, then imaginary parts. Exact, since it is of integers.
#[simd]
fn cross_spectrum(later: &[i8], earlier: &[i8]) -> [i32; 2 * HARMONICS] {
    let mut cross = [0_i32; 2 * HARMONICS];
    let radii = later
        .chunks_exact(2 * HARMONICS)
        .zip(earlier.chunks_exact(2 * HARMONICS));
    for (f, g) in radii {
        for h in 0..HARMONICS {
            let [f_re, f_im] = [f[h], f[HARMONICS + h]].map(i32::from);
            let [g_re, g_im] = [g[h], g[HARMONICS + h]].map(i32::from);
            cross[h] += g_re * f_re + g_im * f_im;
            cross[HARMONICS + h] += g_im * f_re - g_re * f_im;
        }
    }
    cross
}
