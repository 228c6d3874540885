//! Tests the stage by its contract.

use std::process::Command;

#[test]
fn it_keeps_the_contract_of_its_stage() {
    let status = Command::new("gyre")
        .args(["conformance", "@stage@", "--command", env!("CARGO_BIN_EXE_my-@stage@")])
        .status()
        .expect("gyre is in the PATH");
    assert!(status.success(), "it breaks the contract: see above");
}
