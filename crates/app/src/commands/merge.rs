//! `fovea merge`: one film of films that were rendered apart.

use anyhow::{Context, bail};

use crate::cli::MergeArgs;
use crate::output::exr;
use crate::output::{ImageFormat, check_writable};

/// Adds films and writes their sum.
///
/// # Errors
/// A file that is no film, films that do not belong together, or an unwritable output, which is then as it was.
pub fn run(args: &MergeArgs) -> anyhow::Result<()> {
    if ImageFormat::of(&args.output)? != ImageFormat::Exr {
        bail!("{}: a film needs the name of an .exr", args.output.display());
    }
    check_writable(&args.output)?;
    let mut films = args.films.iter();
    let first = films.next().context("no film to merge")?;
    let mut sum = exr::read(first)?;
    for path in films {
        let film = exr::read(path)?;
        sum.merge(&film).with_context(|| format!("{} cannot be added", path.display()))?;
    }
    exr::write(&args.output, &sum)?;
    Ok(())
}
