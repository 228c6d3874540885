/// Columns that are computed at once.
pub const LANES: usize = 16;

/// Channels of values, each with a margin of zeros around it. The margin on the right is so wide
/// that whole blocks of [`LANES`] columns with one more on each side can be read.
#[derive(Debug)]
pub struct Image {
    pub channels: usize,
    pub rows: usize,
    pub columns: usize,
    values: Vec<f32>,
}

impl Image {
    pub fn new([channels, rows, columns]: [usize; 3]) -> Self {
        let mut image = Self {
            channels,
            rows,
            columns,
            values: Vec::new(),
        };
        image.values = vec![0.0; channels * image.plane()];
        image
    }

    pub fn stride(&self) -> usize {
        self.columns.next_multiple_of(LANES) + 2
    }

    fn plane(&self) -> usize {
        (self.rows + 2) * self.stride()
    }

    /// Returns the place of a value among [`Image::values`]. Place 0 is one of the margin.
    pub fn place(&self, channel: usize, row: usize, column: usize) -> usize {
        channel * self.plane() + (row + 1) * self.stride() + column + 1
    }

    pub fn values(&self) -> &[f32] {
        &self.values
    }

    pub fn channel(&self, channel: usize) -> &[f32] {
        let plane = self.plane();
        &self.values[channel * plane..][..plane]
    }

    /// Returns a row of a channel without its margin.
    pub fn row(&self, channel: usize, row: usize) -> &[f32] {
        &self.values[self.place(channel, row, 0)..][..self.columns]
    }

    pub fn row_mut(&mut self, channel: usize, row: usize) -> &mut [f32] {
        let (place, columns) = (self.place(channel, row, 0), self.columns);
        &mut self.values[place..][..columns]
    }
}
