//! Filters over modes that keep Gaussians, for the list: with one mode and with modes that are the same they are what
//! they are without modes.

use crate::list::{Class, Entry, Estimates, Sensor, UnderLaw, World};
use zerre::belief::{Hypotheses, ModalGaussian};
use zerre::filter::{Imm, Linear, RaoBlackwell, SigmaPoints, Tangent};
use zerre::math::Matrix;
use zerre::model::{Chain, JumpMarkov};

pub fn filters<H: Sensor>(world: &World<H>) -> Vec<Entry> {
    let &World { prior, motion, sensor } = world;
    let alone = Chain::staying(1, 1.0).unwrap();
    let uneven = Chain::per_step(vec![vec![0.9, 0.1], vec![0.4, 0.6]]).unwrap();
    let mut list = Vec::new();
    for (chain, name) in [(alone, "one mode"), (uneven, "two modes that are the same")] {
        let model = JumpMarkov::new(vec![motion; chain.len()], chain).unwrap();
        let points = SigmaPoints::default();
        let mut add = |kind: &str, filter: Box<dyn UnderLaw>| {
            list.push(Entry { name: format!("{kind}, {name}"), class: Class::Exact, filter });
        };
        add("extended imm", Box::new(Imm::new(Tangent, model.clone(), sensor, prior).unwrap()));
        add("unscented imm", Box::new(Imm::new(points, model.clone(), sensor, prior).unwrap()));
        let rao = RaoBlackwell::new(Tangent, model.clone(), sensor, prior, 3).unwrap();
        add("extended rao-blackwell", Box::new(rao));
        // They refuse worlds that are not linear.
        if let Ok(imm) = Imm::new(Linear, model.clone(), sensor, prior) {
            add("kalman imm", Box::new(imm));
        }
        if let Ok(rao) = RaoBlackwell::new(Linear, model, sensor, prior, 1) {
            add("kalman rao-blackwell", Box::new(rao));
        }
    }
    list
}

impl Estimates for ModalGaussian<4> {
    fn mean(&self) -> [f64; 4] {
        *self.combined().unwrap().mean()
    }
    fn covariance(&self) -> Matrix<4, 4> {
        *self.combined().unwrap().covariance()
    }
}

impl Estimates for Hypotheses<4> {
    fn mean(&self) -> [f64; 4] {
        Hypotheses::mean(self)
    }
    fn covariance(&self) -> Matrix<4, 4> {
        *self.combined().unwrap().covariance()
    }
}
