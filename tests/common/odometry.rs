//! Reading `odometry.csv`.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChainRow {
    pub seq: u64,
    pub scan: u64,
    pub previous_scan: u64,
}

pub fn rows(csv: &str) -> Vec<ChainRow> {
    let row = |line: &str| {
        let mut fields = line
            .split(',')
            .map(|field| field.parse().unwrap_or(u64::MAX));
        let mut next = || fields.next().unwrap_or(u64::MAX);
        ChainRow {
            seq: next(),
            scan: next(),
            previous_scan: next(),
        }
    };
    csv.lines().skip(1).map(row).collect()
}

pub fn columns(csv: &str, names: &[&str]) -> Vec<Vec<String>> {
    let header: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    let places: Vec<usize> = names
        .iter()
        .map(|name| header.iter().position(|field| field == name).unwrap())
        .collect();
    let row = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        places
            .iter()
            .map(|place| fields[*place].to_owned())
            .collect()
    };
    csv.lines().skip(1).map(row).collect()
}

/// Asserts that each motion begins where the one before ended.
pub fn assert_unbroken(rows: &[ChainRow]) {
    for pair in rows.windows(2) {
        assert_eq!(pair[1].previous_scan, pair[0].scan, "{pair:?}");
        assert_eq!(pair[1].seq, pair[0].seq + 1, "{pair:?}");
    }
}
