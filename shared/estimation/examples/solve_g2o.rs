//! Solves pose graphs of g2o files by plain least squares, from the poses in the file: `solve_g2o [--repeat N] FILE...`.
//!
//! Prints a line a file: poses, edges, cost at the start and at the solution (half the sum of chi-squares), linearisations, and the
//! median time of a solution in ms, with the analysis of the structure. `compare_gtsam.py` beside this file compares with GTSAM.

use std::error::Error;
use std::time::Instant;

use gyre_estimation::{G2o, GraphOptions, Kernel, PoseGraph};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1).peekable();
    let mut repeat = 1;
    if arguments.next_if_eq("--repeat").is_some() {
        repeat = arguments.next().ok_or("--repeat needs a number")?.parse()?;
    }
    for file in arguments {
        let content = G2o::parse(&std::fs::read_to_string(&file)?)?;
        println!("{file} {}", solve(&content, repeat)?);
    }
    Ok(())
}

fn solve(content: &G2o, repeat: usize) -> Result<String, Box<dyn Error>> {
    let options = GraphOptions {
        gate: f64::INFINITY,
        kernel: Kernel::None,
        ..GraphOptions::default()
    };
    let start = content.poses.first().copied().unwrap_or_default();
    let mut times_ms = Vec::new();
    let mut report = String::new();
    for _ in 0..repeat {
        let mut graph = PoseGraph::new(start, options.clone());
        for constraint in &content.constraints {
            graph.apply(constraint)?;
        }
        if !content.poses.is_empty() {
            graph.start_from(&content.poses)?;
        }
        let before = graph.cost();
        let began = Instant::now();
        let solution = graph.solve()?;
        times_ms.push(1e3 * began.elapsed().as_secs_f64());
        times_ms.sort_by(f64::total_cmp);
        report = format!(
            "poses {} edges {} start {before:.6} cost {:.6} iterations {} ms {:.2}",
            graph.poses().len(),
            content.constraints.len(),
            solution.cost,
            solution.iterations,
            times_ms[times_ms.len() / 2],
        );
    }
    Ok(report)
}
