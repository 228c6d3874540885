//! One effect with its pictures.

use std::fs;
use std::path::Path;

use gyre_worlds::Effects;

use crate::picture::{Frame, Picture};
use crate::shot::Shot;

/// One effect with its pictures; `gallery/README.md` describes it.
pub struct Exhibit {
    /// Heading; pictures are named after it.
    pub title: &'static str,
    /// Captions and pictures.
    pub pictures: Vec<(&'static str, Picture)>,
}

impl Exhibit {
    /// Pictures of an effect off and on.
    pub fn switched(
        title: &'static str,
        shot: &Shot,
        frame: &Frame,
        switch: fn(&mut Effects) -> &mut bool,
    ) -> Self {
        Self::off_and_on(title, |on| {
            let shot = shot.with_effects(|effects| *switch(effects) = on);
            frame.picture(&[shot.scan()])
        })
    }

    /// Pictures of an effect off and on, drawn by a function.
    pub fn off_and_on(title: &'static str, picture: impl Fn(bool) -> Picture) -> Self {
        Self::of(title, vec![("off", picture(false)), ("on", picture(true))])
    }

    /// An exhibit of any pictures.
    pub fn of(title: &'static str, pictures: Vec<(&'static str, Picture)>) -> Self {
        Self { title, pictures }
    }

    fn file(&self, caption: &str) -> String {
        let name = format!("{} {caption}", self.title).to_lowercase();
        let words = name
            .split(|c: char| !c.is_ascii_alphanumeric())
            .filter(|word| !word.is_empty());
        words.collect::<Vec<_>>().join("-") + ".png"
    }

    /// Writes its pictures and returns their size in bytes.
    pub fn write(&self, folder: &Path) -> Result<usize, Box<dyn std::error::Error>> {
        let mut bytes = 0;
        for (caption, picture) in &self.pictures {
            let png = picture.png()?;
            bytes += png.len();
            fs::write(folder.join(self.file(caption)), png)?;
        }
        Ok(bytes)
    }
}
