// SPDX-License-Identifier: MPL-2.0

//! Places that somebody has pointed to in the pictures of two cameras.

use std::collections::BTreeMap;

use ptztrack_contract::lock::lock;

use super::Dispatcher;
use super::view::View;
use crate::camera::Pointed;
use crate::config::HandOver;
use crate::event::Level;

impl Dispatcher {
    /// What somebody says.
    pub(super) fn take_points(&mut self, wishes: &[HandOver], views: &BTreeMap<String, View>) {
        for (to, called) in views {
            for pointed in std::mem::take(&mut *lock(&called.known.points)) {
                let said = self.point(wishes, views, to, &pointed);
                let (Ok(detail) | Err(detail)) = said.clone();
                let level = if said.is_ok() { Level::Info } else { Level::Warning };
                self.tell(to, level, "pointed", detail);
                // Whoever asked may have gone.
                let _ = pointed.answer.send(said);
            }
        }
    }

    fn point(
        &mut self,
        wishes: &[HandOver],
        views: &BTreeMap<String, View>,
        to: &str,
        Pointed { from, there, here, .. }: &Pointed,
    ) -> Result<String, String> {
        if !wishes.iter().any(|wish| wish.from == *from && wish.calls.iter().any(|called| called == to)) {
            return Err(format!("{from} does not call it: [handover.{from}] says who calls whom"));
        }
        let (caller, called) = (views.get(from), views.get(to));
        let place = caller.and_then(|caller| caller.place_of(*there));
        let direction = called.and_then(|called| called.direction_of(*here));
        let both = format!("{:.2},{:.2} of {from} at {:.2},{:.2}", there.x, there.y, here.x, here.y);
        match place.zip(direction) {
            None => {
                Err(format!("cannot take {both}: one of the cameras turns or does not report where it looks"))
            }
            Some((place, direction)) if self.link(from, to).point(place, direction) => {
                Ok(format!("sees {both}, as told by hand"))
            }
            Some(_) => Err(format!("cannot see {both}, by what was learned")),
        }
    }
}
