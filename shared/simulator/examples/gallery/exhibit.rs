//! One effect with its pictures.

use std::fs;
use std::path::Path;

use gyre_simulator::Effects;

use crate::picture::{Frame, Picture};
use crate::shot::Shot;

/// One effect with its pictures.
pub struct Exhibit {
    /// Heading; pictures are named after it.
    pub title: &'static str,
    /// The key that switches it, if one does.
    pub key: Option<&'static str>,
    /// What there is to see, in a sentence.
    pub says: &'static str,
    /// Where it is taken from: literature or data.
    pub source: &'static str,
    /// Captions and pictures.
    pub pictures: Vec<(&'static str, Picture)>,
}

impl Exhibit {
    /// An effect off and on.
    pub fn switched(
        (title, key): (&'static str, &'static str),
        shot: &Shot,
        frame: &Frame,
        switch: fn(&mut Effects) -> &mut bool,
    ) -> Self {
        let picture = |on| {
            let mut shot = shot.clone();
            *switch(&mut shot.effects) = on;
            frame.picture(&[shot.scan()])
        };
        Self::of(title, vec![("off", picture(false)), ("on", picture(true))]).switch(key)
    }

    /// Any pictures.
    pub fn of(title: &'static str, pictures: Vec<(&'static str, Picture)>) -> Self {
        Self {
            title,
            key: None,
            says: "",
            source: "",
            pictures,
        }
    }

    /// The same with the key that switches it.
    pub fn switch(self, key: &'static str) -> Self {
        Self {
            key: Some(key),
            ..self
        }
    }

    /// The same with its words.
    pub fn words(self, says: &'static str, source: &'static str) -> Self {
        Self {
            says,
            source,
            ..self
        }
    }

    fn file(&self, caption: &str) -> String {
        let name = format!("{} {caption}", self.title).to_lowercase();
        let words = name
            .split(|c: char| !c.is_ascii_alphanumeric())
            .filter(|word| !word.is_empty());
        words.collect::<Vec<_>>().join("-") + ".png"
    }

    /// Its part of the page.
    pub fn markdown(&self) -> String {
        let key = self
            .key
            .map_or(String::new(), |key| format!(" (`effects.{key}`)"));
        let row = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let captions = row(self
            .pictures
            .iter()
            .map(|(caption, _)| (*caption).to_owned())
            .collect());
        let rule = row(vec!["---".to_owned(); self.pictures.len()]);
        let image = |caption: &str| format!("![{}, {caption}]({})", self.title, self.file(caption));
        let images = row(self
            .pictures
            .iter()
            .map(|(caption, _)| image(caption))
            .collect());
        format!(
            "\n### {}{key}\n\n{}\n\nSource: {}.\n\n{captions}{rule}{images}",
            self.title, self.says, self.source
        )
    }

    /// Writes its pictures and says how many bytes they take.
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
