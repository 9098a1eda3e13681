# Makes reference.json: the values that the tests of the statistics must equal to 1e-6.
# Rscript tests/analysis/statistics/reference.R > tests/analysis/statistics/reference.json
# R 4.2.2 with car 3.1-1, psych 2.2.9, lme4 1.1-31, nlme 3.1-162; the data are printed beside.
suppressPackageStartupMessages({library(car); library(psych); library(lme4); library(nlme)})
options(digits = 17)

number <- function(x) {
  text <- formatC(x, digits = 17, format = "g")
  paste0(text, collapse = ", ")
}
json <- function(x) {
  if (is.list(x)) {
    parts <- mapply(function(n, v) paste0('"', n, '": ', json(v)), names(x), x)
    paste0("{", paste0(parts, collapse = ",\n"), "}")
  } else if (is.matrix(x)) {
    rows <- apply(x, 1, function(r) paste0("[", number(r), "]"))
    paste0("[", paste0(rows, collapse = ", "), "]")
  } else if (length(x) == 1) number(x) else paste0("[", number(x), "]")
}
v <- function(x) as.numeric(x)
quietly <- suppressWarnings

set.seed(20)
n <- 34
x <- rnorm(n); y <- 0.5 * x + rnorm(n)
cone <- rnorm(n); cone_y <- 0.4 * cone + exp(0.8 * cone) * rnorm(n)
skewed <- rexp(n)^2
likert_x <- sample(1:5, n, TRUE); likert_y <- pmin(7, likert_x + sample(0:3, n, TRUE))
small_x <- c(2.1, -0.3, 1.7, 0.4, 3.3, -1.2, 0.9); small_y <- c(1.0, 0.2, 2.9, -0.6, 2.2, 0.1, 0.3)

correlation <- function(x, y, method, ...) {
  t <- quietly(cor.test(x, y, method = method, ...))
  c(list(r = v(t$estimate), p = t$p.value), if (!is.null(t$conf.int)) list(interval = v(t$conf.int)))
}
shapiro <- function(x) { s <- shapiro.test(x); list(w = v(s$statistic), p = s$p.value) }
score <- function(x, y) { s <- ncvTest(lm(y ~ x)); list(chi2 = s$ChiSquare, p = s$p) }

embedding <- cbind(rnorm(n), rnorm(n), rnorm(n))
construct <- 0.6 * embedding[, 1] - 0.4 * embedding[, 3] + rnorm(n)
fit <- summary(lm(construct ~ embedding))

women <- rnorm(10, 0.8, 2); men <- rnorm(24)
welch <- t.test(women, men)

group <- c(rep(TRUE, 10), rep(FALSE, 24))
scatter <- (9 * cov(embedding[group, ]) + 23 * cov(embedding[!group, ])) / 32
gap <- colMeans(embedding[group, ]) - colMeans(embedding[!group, ])
distance <- sqrt(v(t(gap) %*% solve(scatter) %*% gap))

# Three conditions within 12 people: rounded scores have ties; success is yes or no.
people <- rnorm(12, 0, 2)
scores <- cbind(people + rnorm(12), people + 0.9 + rnorm(12, 0, 2), people + 1.4 + rnorm(12, 0, 0.5))
rounded <- round(scores)
success <- 1 * (scores > 0.8)
long <- function(m) data.frame(y = as.vector(m), condition = factor(rep(seq_len(ncol(m)), each = nrow(m))),
                               person = factor(rep(seq_len(nrow(m)), ncol(m))))
d <- long(scores)
anova_parts <- summary(aov(y ~ condition + Error(person / condition), d))[["Error: person:condition"]][[1]]
multivariate <- lm(scores ~ 1)
corrected <- quietly(summary(Anova(multivariate, idata = data.frame(condition = factor(1:3)),
                                   idesign = ~condition, type = 3), multivariate = FALSE))
f <- friedman.test(scores); fr <- friedman.test(rounded); q <- friedman.test(success)
dl <- long(success)
cmh <- mantelhaen.test(table(dl$condition, dl$y, dl$person))
w <- wilcox.test(scores[, 1], scores[, 2], paired = TRUE, conf.int = TRUE)
wt <- quietly(wilcox.test(rounded[, 1], rounded[, 2], paired = TRUE))
only_first <- sum(success[, 1] > success[, 3]); only_second <- sum(success[, 1] < success[, 3])
b <- binom.test(only_first, only_first + only_second)
b2 <- binom.test(3, 12)

p_values <- c(.28, .18, .15, .75, .22, .43, .89, .16, .34, 7e-6, 4.5e-6)

# y ~ condition + order with a random intercept a person; one row is missing.
orders <- t(sapply(1:12, function(i) list(1:3, c(1,3,2), c(2,1,3), c(2,3,1), c(3,1,2), 3:1)[[(i - 1) %% 6 + 1]]))
d$order <- as.vector(orders)
mixed_rows <- d[-5, ]
tight <- lmerControl(optimizer = "nloptwrap", optCtrl = list(xtol_abs = 1e-14, ftol_abs = 1e-14, xtol_rel = 1e-14, ftol_rel = 1e-14, maxeval = 100000))
m <- lmer(y ~ condition + order + (1 | person), mixed_rows, REML = TRUE, control = tight)
co <- coef(summary(m)); vc <- as.data.frame(VarCorr(m))
nl <- lme(y ~ condition + order, random = ~1 | person, mixed_rows,
          control = lmeControl(tolerance = 1e-14, msTol = 1e-14, maxIter = 500, msMaxIter = 500))
flat_rows <- d; flat_rows$y <- flat_rows$y - ave(flat_rows$y, flat_rows$person) + 0.2 * rnorm(36)
mf <- quietly(suppressMessages(lmer(y ~ condition + order + (1 | person), flat_rows, control = tight)))
cf <- coef(summary(mf)); vf <- as.data.frame(VarCorr(mf))

items <- cbind(likert_x, likert_y, pmax(1, pmin(7, likert_x + sample(-1:2, n, TRUE))), pmax(1, pmin(7, 4 + sample(-3:3, n, TRUE) + (likert_y > 4))))
colnames(items) <- paste0("i", 1:4)
invisible(capture.output(quietly({a3 <- psych::alpha(items[, 1:3]); a4 <- psych::alpha(items)})))

cat(json(list(
  data = list(x = x, y = y, cone = cone, cone_y = cone_y, skewed = skewed, likert_x = likert_x,
              likert_y = likert_y, small_x = small_x, small_y = small_y, embedding = embedding,
              construct = construct, women = women, men = men, scores = scores, rounded = rounded,
              success = success, p_values = p_values, items = items, mixed_y = mixed_rows$y,
              mixed_condition = v(mixed_rows$condition), mixed_order = v(mixed_rows$order),
              mixed_person = v(mixed_rows$person), flat_y = flat_rows$y,
              flat_condition = v(flat_rows$condition), flat_order = v(flat_rows$order),
              flat_person = v(flat_rows$person)),
  shapiro = list(normal = shapiro(x), skewed = shapiro(skewed), small = shapiro(small_x), likert = shapiro(likert_x)),
  score_test = list(even = score(x, y), cone = score(cone, cone_y), small = score(small_x, small_y)),
  pearson = list(even = correlation(x, y, "pearson"), small = correlation(small_x, small_y, "pearson"),
                 cone = correlation(cone, cone_y, "pearson")),
  spearman = list(even = correlation(x, y, "spearman", exact = FALSE),
                  ties = correlation(likert_x, likert_y, "spearman", exact = FALSE),
                  small = correlation(small_x, small_y, "spearman"),
                  small_reversed = correlation(small_x, -small_y, "spearman")),
  multiple = list(r2 = fit$r.squared, adjusted_r2 = fit$adj.r.squared,
                  f_p = v(pf(fit$fstatistic[1], fit$fstatistic[2], fit$fstatistic[3], lower.tail = FALSE))),
  welch = list(t = v(welch$statistic), freedom = v(welch$parameter), p = welch$p.value, interval = v(welch$conf.int)),
  hotelling = list(t2 = distance^2 * 240 / 34, distance = distance),
  holm = p.adjust(p_values, "holm"), bh = p.adjust(p_values, "BH"),
  friedman = list(chi2 = v(f$statistic), p = f$p.value), friedman_ties = list(chi2 = v(fr$statistic), p = fr$p.value),
  cochran = list(q = v(q$statistic), p = q$p.value, cmh = v(cmh$statistic)),
  repeated = list(f = anova_parts[1, "F value"], p = anova_parts[1, "Pr(>F)"],
                  epsilon = corrected$pval.adjustments[1, "GG eps"], p_gg = corrected$pval.adjustments[1, "Pr(>F[GG])"],
                  partial_eta2 = anova_parts[1, "Sum Sq"] / sum(anova_parts[, "Sum Sq"])),
  wilcoxon = list(v = v(w$statistic), p = w$p.value, shift = v(w$estimate), interval = v(w$conf.int)),
  wilcoxon_ties = list(v = v(wt$statistic), p = wt$p.value),
  mcnemar = list(p = b$p.value, share = v(b$estimate), interval = v(b$conf.int)),
  mcnemar_3_of_12 = list(p = b2$p.value, share = v(b2$estimate), interval = v(b2$conf.int)),
  mixed = list(coefficients = v(co[, 1]), errors = v(co[, 2]), person_sd = vc$sdcor[1], residual_sd = vc$sdcor[2],
               freedom = v(summary(nl)$tTable[, "DF"]), p = v(summary(nl)$tTable[, "p-value"]),
               condition_f = anova(nl, type = "marginal")["condition", "F-value"],
               condition_p = anova(nl, type = "marginal")["condition", "p-value"]),
  mixed_flat = list(coefficients = v(cf[, 1]), errors = v(cf[, 2]), person_sd = vf$sdcor[1], residual_sd = vf$sdcor[2]),
  alpha = list(three = a3$total$raw_alpha, four = a4$total$raw_alpha,
               three_interval = v(c(a3$feldt$lower.ci, a3$feldt$upper.ci)),
               four_interval = v(c(a4$feldt$lower.ci, a4$feldt$upper.ci)))
)), "\n")
