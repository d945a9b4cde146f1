// SPDX-License-Identifier: MPL-2.0

//! Who gets which observation: the cheapest assignment of all at once (Kuhn 1955, Munkres 1957; by shortest augmenting paths as
//! Jonker and Volgenant 1987).

/// Rows and columns that can have anything to do with each other, at most; of larger groups each takes the best that is left.
const MAX_SIDE: usize = 12;

/// A row, a column, and what it costs that the row gets the column.
type Pair = (usize, usize, f32);

/// Assigns columns to rows, and keeps its memory for the next time.
#[derive(Debug, Default)]
pub(super) struct Assigner {
    pairs: Vec<Pair>,
    /// For each row and then each column another of its group; itself for one of each group.
    group_of: Vec<usize>,
    members: Vec<Pair>,
    rows: Vec<usize>,
    columns: Vec<usize>,
    paths: ShortestPaths,
}

impl Assigner {
    /// Leaves in `assigned` for each row the column that it gets, so that the sum of `cost(row, column)` is least and as many as
    /// possible get one; `None` is a pair that cannot be.
    ///
    /// Pairs that can be fall apart into groups, which are solved by themselves: the time is bounded however many there are.
    pub fn assign(
        &mut self,
        rows: usize,
        columns: usize,
        cost: impl Fn(usize, usize) -> Option<f32>,
        assigned: &mut Vec<Option<usize>>,
    ) {
        assigned.clear();
        assigned.resize(rows, None);
        let pairs = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        self.pairs.clear();
        self.pairs.extend(pairs.filter_map(|(row, column)| Some((row, column, cost(row, column)?))));
        self.group_of.clear();
        self.group_of.extend(0..rows + columns);
        for (row, column, _) in &self.pairs {
            let (one, other) = (root(&self.group_of, *row), root(&self.group_of, rows + column));
            self.group_of[one] = other;
        }
        for group in 0..rows + columns {
            if self.group_of[group] == group {
                let Self { pairs, members, group_of, .. } = self;
                members.clear();
                members.extend(pairs.iter().filter(|(row, ..)| root(group_of, *row) == group));
                self.solve(assigned);
            }
        }
    }

    /// Solves the group of `members`.
    fn solve(&mut self, assigned: &mut [Option<usize>]) {
        let Self { members, rows, columns, paths, .. } = self;
        distinct(members.iter().map(|pair| pair.0), rows);
        distinct(members.iter().map(|pair| pair.1), columns);
        if rows.len() > MAX_SIDE || columns.len() > MAX_SIDE {
            members.sort_unstable_by(|a, b| a.2.total_cmp(&b.2));
            for &(row, column, _) in &*members {
                if assigned[row].is_none() && !assigned.contains(&Some(column)) {
                    assigned[row] = Some(column);
                }
            }
            return;
        }
        // More than any number of real pairs costs, so that nobody goes without who need not.
        let impossible = 1.0 + 2.0 * members.iter().map(|(.., cost)| cost.abs()).sum::<f32>();
        paths.begin(rows.len().max(columns.len()), impossible);
        for &(row, column, cost) in &*members {
            if let (Ok(row), Ok(column)) = (rows.binary_search(&row), columns.binary_search(&column)) {
                paths.set(row, column, cost);
            }
        }
        paths.solve();
        for (row, column) in paths.pairs().filter(|&(row, column)| paths.cost(row, column) < impossible) {
            assigned[rows[row]] = Some(columns[column]);
        }
    }
}

fn root(group_of: &[usize], mut place: usize) -> usize {
    while group_of[place] != place {
        place = group_of[place];
    }
    place
}

/// Leaves each of `values` once in `found`, in order.
fn distinct(values: impl Iterator<Item = usize>, found: &mut Vec<usize>) {
    found.clear();
    found.extend(values);
    found.sort_unstable();
    found.dedup();
}

/// A square matrix of costs, and the cheapest way to give each row a column. Places are counted from 1: 0 is where each path starts.
#[derive(Debug, Default)]
struct ShortestPaths {
    side: usize,
    costs: Vec<f32>,
    of_rows: Vec<f32>,
    of_columns: Vec<f32>,
    /// For each column its row.
    row_of: Vec<usize>,
    least: Vec<f32>,
    way: Vec<usize>,
    used: Vec<bool>,
}

impl ShortestPaths {
    fn begin(&mut self, side: usize, cost: f32) {
        self.side = side;
        refill(&mut self.costs, side * side, cost);
        refill(&mut self.of_rows, side + 1, 0.0);
        refill(&mut self.of_columns, side + 1, 0.0);
        refill(&mut self.row_of, side + 1, 0);
    }

    fn set(&mut self, row: usize, column: usize, cost: f32) {
        self.costs[row * self.side + column] = cost;
    }

    fn cost(&self, row: usize, column: usize) -> f32 {
        self.costs[row * self.side + column]
    }

    /// Rows with their columns.
    fn pairs(&self) -> impl Iterator<Item = (usize, usize)> {
        self.row_of[1..].iter().enumerate().map(|(column, row)| (row - 1, column))
    }

    fn solve(&mut self) {
        for row in 1..=self.side {
            self.row_of[0] = row;
            refill(&mut self.least, self.side + 1, f32::INFINITY);
            refill(&mut self.way, self.side + 1, 0);
            refill(&mut self.used, self.side + 1, false);
            let mut column = 0;
            while self.row_of[column] != 0 {
                column = self.step(column);
            }
            while column != 0 {
                self.row_of[column] = self.row_of[self.way[column]];
                column = self.way[column];
            }
        }
    }

    /// Goes on from a column to the nearest that was not used.
    fn step(&mut self, column: usize) -> usize {
        self.used[column] = true;
        let from = self.row_of[column];
        let (mut step, mut next) = (f32::INFINITY, 0);
        for to in 1..=self.side {
            if self.used[to] {
                continue;
            }
            let reduced = self.cost(from - 1, to - 1) - self.of_rows[from] - self.of_columns[to];
            if reduced < self.least[to] {
                (self.least[to], self.way[to]) = (reduced, column);
            }
            if self.least[to] < step || next == 0 {
                (step, next) = (self.least[to], to);
            }
        }
        for place in 0..=self.side {
            if self.used[place] {
                self.of_rows[self.row_of[place]] += step;
                self.of_columns[place] -= step;
            } else {
                self.least[place] -= step;
            }
        }
        next
    }
}

fn refill<T: Copy>(values: &mut Vec<T>, count: usize, value: T) {
    values.clear();
    values.resize(count, value);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Costs = Vec<Vec<Option<f32>>>;

    fn assigned(
        rows: usize,
        columns: usize,
        cost: impl Fn(usize, usize) -> Option<f32>,
    ) -> Vec<Option<usize>> {
        let mut found = Vec::new();
        Assigner::default().assign(rows, columns, cost, &mut found);
        found
    }

    fn of(costs: &Costs) -> Vec<Option<usize>> {
        assigned(costs.len(), costs.first().map_or(0, Vec::len), |row, column| costs[row][column])
    }

    /// How many get a column, and what that costs: by trying everything.
    fn best(costs: &Costs, row: usize, taken: u32) -> (usize, f32) {
        let Some(line) = costs.get(row) else { return (0, 0.0) };
        let mut found = best(costs, row + 1, taken);
        for (column, cost) in line.iter().enumerate() {
            if let Some(cost) = cost
                && taken & (1 << column) == 0
            {
                let (count, sum) = best(costs, row + 1, taken | (1 << column));
                if count + 1 > found.0 || (count + 1 == found.0 && sum + cost < found.1) {
                    found = (count + 1, sum + cost);
                }
            }
        }
        found
    }

    fn any_costs() -> impl Strategy<Value = Costs> {
        (0usize..5, 1usize..5).prop_flat_map(|(rows, columns)| {
            let pair = prop::option::weighted(0.6, (0u8..100).prop_map(f32::from));
            prop::collection::vec(prop::collection::vec(pair, columns), rows)
        })
    }

    proptest! {
        #[test]
        fn no_assignment_is_better(costs in any_costs()) {
            let found = of(&costs);
            let pairs = found.iter().enumerate().filter_map(|(row, column)| Some(costs[row][(*column)?]));
            let chosen: Vec<f32> = pairs.map(|cost| cost.expect("only pairs that can be")).collect();
            prop_assert_eq!((chosen.len(), chosen.iter().sum::<f32>()), best(&costs, 0, 0));
            let mut columns: Vec<_> = found.iter().flatten().collect();
            columns.sort_unstable();
            prop_assert!(columns.windows(2).all(|pair| pair[0] != pair[1]));
        }
    }

    #[test]
    fn nobody_takes_the_only_one_of_somebody_else() {
        let costs = vec![vec![Some(1.0), Some(2.0)], vec![Some(1.5), None]];
        assert_eq!(of(&costs), [Some(1), Some(0)]);
    }

    #[test]
    fn a_hundred_by_a_hundred_is_assigned_at_once() {
        let found = assigned(100, 100, |row, column| Some(row.abs_diff(column) as f32));
        assert!(found.iter().enumerate().all(|(row, column)| *column == Some(row)));
    }
}
