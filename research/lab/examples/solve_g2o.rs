//! Solves pose graphs of g2o files by plain least squares, from the poses in the file:
//! `solve_g2o [--out DIR] FILE...`.
//!
//! Prints a line a file: poses, edges, cost at the start and at the solution (half the sum of
//! chi-squares), linearisations, and the time of the solution in ms, with the analysis of the
//! structure. `--out` writes the solutions as files of the same names. `compare_gtsam.py` beside
//! this file compares with GTSAM.

use std::{error::Error, path::{Path, PathBuf}, time::Instant};

use gyre_slam::estimation::{G2o, GraphOptions, Kernel, PoseGraph};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1).peekable();
    let mut out = None;
    if arguments.next_if_eq("--out").is_some() {
        out = Some(PathBuf::from(
            arguments.next().ok_or("--out needs a folder")?,
        ));
    }
    for file in arguments.map(PathBuf::from) {
        let content = G2o::parse(&std::fs::read_to_string(&file)?)?;
        let mut graph = graph(&content)?;
        let start = graph.cost();
        let began = Instant::now();
        let solution = graph.solve()?;
        if !solution.converged {
            eprintln!("{}: not converged", file.display());
        }
        println!(
            "{} poses {} edges {} start {start:.6} cost {:.6} iterations {} ms {:.2}",
            file.display(),
            graph.poses().len(),
            content.constraints.len(),
            solution.cost,
            solution.iterations,
            1e3 * began.elapsed().as_secs_f64(),
        );
        if let Some(out) = &out {
            let name = file.file_name().map_or(Path::new("solved.g2o"), Path::new);
            std::fs::write(
                out.join(name),
                G2o::write(graph.poses(), graph.constraints()),
            )?;
        }
    }
    Ok(())
}

/// Returns the graph of all constraints, none of them rejected or weighted down, at the poses of
/// the file.
fn graph(content: &G2o) -> Result<PoseGraph, Box<dyn Error>> {
    let options = GraphOptions {
        gate: f64::INFINITY,
        kernel: Kernel::None,
        ..GraphOptions::default()
    };
    let first = content.poses.first().copied().unwrap_or_default();
    let mut graph = PoseGraph::new(first, options);
    for constraint in &content.constraints {
        graph.apply(constraint)?;
    }
    if !content.poses.is_empty() {
        graph.start_from(&content.poses)?;
    }
    Ok(graph)
}
