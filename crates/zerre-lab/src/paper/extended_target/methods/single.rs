//! Methods that know one ellipse, or one outline.

use super::super::scenario::{motion, prior};
use super::super::settings::{
    AXES_DEVIATIONS, CONTOUR, CONTOUR_CORNERS, EXTENT_DOF, EXTENT_VARIANCE, FLOOR, LEAST_AXIS,
};
use super::{Body, Estimate, Task, filtered};
use zerre::Result;
use zerre::belief::Gaussian;
use zerre::extended::centre::FirstTwo;
use zerre::extended::contour::Contour;
use zerre::extended::inverse_wishart::InverseWishart;
use zerre::extended::mem_ekf::{MemEkf, MemSettings};
use zerre::extended::random_matrix::{RandomMatrix, RandomMatrixSettings, Rule};
use zerre::math::Matrix;

/// The noise of the motion is that at the first extent.
pub const KOCH: Rule = Rule::Koch { unit: EXTENT_VARIANCE };

fn place(state: &Gaussian<4>) -> [f64; 2] {
    let [x, y, ..] = *state.mean();
    [x, y]
}

pub fn random_matrix(task: &Task<'_>, rule: Rule) -> Result<Vec<Estimate>> {
    let extent = InverseWishart::new(Matrix::identity() * EXTENT_VARIANCE, EXTENT_DOF)?;
    let settings = RandomMatrixSettings { rule, floor: FLOOR, ..RandomMatrixSettings::default() };
    let filter = RandomMatrix::new(motion()?, FirstTwo, prior()?, extent, settings)?;
    filtered(task, &filter, |belief| Ok(Estimate::ellipses(place(&belief.state), belief.shape()?)))
}

pub fn mem_ekf(task: &Task<'_>) -> Result<Vec<Estimate>> {
    let axis = EXTENT_VARIANCE.sqrt();
    let axes = Gaussian::independent([0.0, axis, axis], AXES_DEVIATIONS)?;
    // Points are normal: the semi-axes are their standard deviations.
    let settings = MemSettings { multiplicative: 1.0, floor: LEAST_AXIS, ..MemSettings::default() };
    let filter = MemEkf::new(motion()?, FirstTwo, prior()?, axes, settings)?;
    filtered(task, &filter, |belief| Ok(Estimate::ellipses(place(&belief.state), belief.shape()?)))
}

pub fn star_convex(task: &Task<'_>) -> Result<Vec<Estimate>> {
    let filter: Contour<_, _, 4, 4> = Contour::new(motion()?, FirstTwo, prior()?, CONTOUR)?;
    filtered(task, &filter, |belief| {
        let centre = place(&belief.state);
        let outline = filter.outline(belief, CONTOUR_CORNERS)?;
        let corners = outline.iter().map(|p| [p.at[0] - centre[0], p.at[1] - centre[1]]).collect();
        Ok(Estimate { centre, body: Body::Outline(corners), clutter: None })
    })
}
