//! The rows.

/// Calls `$callback!` with the rows of all kernels, in the order of the data and in the form of
/// [`normal_rows`](crate::normal_rows); [`rows`](crate::rows) has the grammar. What the rows name is in scope after
/// `use viewfuse_kernels::rows::*`.
#[macro_export]
macro_rules! for_each_kernel {
    ($callback:ident) => {
        $crate::normal_rows! { $callback
            /// Rays of a target's pixels. An element is a ray.
            CastRays cast_rays(block: CastBlock; ray_count) for ray in [0..ray_count; 1024 a core] {
                read pixels: u32,
                write rays: TargetRay,
            }
            /// Evenly spread depths on rays: `depths[ray][sample]`. An element is a sample.
            CoarseDepths coarse_depths(block: CoarseBlock; ray_count)
            for sample in [0..ray_count * block.sample_count; 1024 a core] {
                read rays: TargetRay,
                read pixels: u32,
                write depths: f32,
            }
            /// Points of the samples in a list, which number rays and samples flat, or of all samples: `points[point]`
            /// from `depths[ray][sample]`. An element is a point.
            PlacePoints place_points(block: PlaceBlock; point_count) for point in [0..point_count; 1024 a core] {
                optional samples: u32 = depths if !block.has_samples,
                read rays: TargetRay,
                read depths: f32,
                write points: RayPoint,
            }
            /// Features of points in the axes of views: `embedded[view][point][feature]`. An element is a feature of a
            /// point in a view.
            EmbedPoints embed_points(block: EmbedBlock; view_count)
            for feature in [0..view_count * block.point_count * block.row_len()], twin {
                read views: CameraBlock as vectors,
                read points: RayPoint as vectors,
                write embedded: f32,
            }
            /// Weights of views at points: `visible[point][view]`. An element is a view of a point.
            VisibleWeights visible_weights(view_count: u32; point_count)
            for weight in [0..point_count * view_count; 512 a core] {
                read views: CameraBlock as vectors,
                read weights: f32,
                read points: RayPoint as vectors,
                write visible: f32,
            }
            /// Latents where points appear in a view: its part of `gathered[view][point][channel]`, from the view's
            /// `grid[row][column][channel]`. An element is four channels of a point.
            GatherLatents gather_latents(block: GatherBlock)
                for four in [0..block.point_count * block.four_count()], twin {
                read views: CameraBlock as vectors,
                read points: RayPoint as vectors,
                read grid: f32,
                optional residual: f32 = grid if !block.has_residual,
                write gathered: f32,
            }
            /// Features where points lie in a view's volume: its part of `gathered[view][point][feature]`, from the
            /// view's `volume[row][column][depth][feature]`. An element is a feature of a point.
            GatherVolume gather_volume(block: VolumeBlock)
                for feature in [0..block.point_count * block.feature_count], twin {
                read views: CameraBlock as vectors,
                read points: RayPoint as vectors,
                read volume: f32,
                write gathered: f32,
            }
            /// Numbers in half precision (f16), two in a word, the first in the lower half. An element is a word.
            PackF16 pack_f16(number_count: u32) for word in [0..word_count(*number_count); 4096 a core] {
                read numbers: f32,
                write words: u32,
            }
            /// Factors in half precision, two in a word, the first in the lower half: NaN for what is larger than
            /// 65,504. An element is a word.
            PackFactors pack_factors(number_count: u32) for word in [0..word_count(*number_count); 4096 a core] {
                read numbers: f32,
                write words: u32,
            }
            /// As `gather_latents`, from the words of a grid in half precision. An element is four channels of a point.
            GatherLatentsF16 gather_latents_f16(block: GatherBlock)
            for four in [0..block.point_count * block.four_count()], twin {
                read views: CameraBlock as vectors,
                read points: RayPoint as vectors,
                read grid: u32,
                optional residual: f32 = grid if !block.has_residual,
                write gathered: f32,
            }
            /// As `gather_volume`, from the words of a volume in half precision. An element is a feature of a point.
            GatherVolumeF16 gather_volume_f16(block: VolumeBlock)
            for feature in [0..block.point_count * block.feature_count], twin {
                read views: CameraBlock as vectors,
                read points: RayPoint as vectors,
                read volume: u32,
                write gathered: f32,
            }
            /// Convolutions of an image, summed in an order of the device's choice. An element is an 8x8 part of a tile
            /// of `TILE` pixels and channels.
            Convolve convolve(block: ConvolveBlock)
                tiles [block.pixel_count(), block.patch_len(), block.out_channels], twin {
                filled inputs: f32,
                layer weights: f32,
                filled bias: f32,
                optional residual: f32 = bias if !block.has_residual,
                write outputs: f32,
            }
            /// Convolutions of every channel by itself, with `weights[place of the window][channel]`. An element is a
            /// channel of an output pixel.
            ConvolveDepthwise convolve_depthwise(block: DepthwiseBlock)
            for channel in [0..block.pixel_count() * block.channels; 2048 a core] {
                filled inputs: f32,
                filled weights: f32,
                write outputs: f32,
            }
            /// Transposed convolutions, summed in an order of the device's choice, with `bias[output channel]`. An
            /// element is an 8x8 part of a tile of `TILE` input pixels and what they become.
            ConvolveTransposed convolve_transposed(block: TransposedBlock)
            tiles [block.pixel_count(), block.in_channels, block.column_count()], twin {
                filled inputs: f32,
                layer weights: f32,
                filled bias: f32,
                write outputs: f32,
            }
            /// Largest values of windows. An element is a channel of an output pixel.
            MaxPool max_pool(block: PoolBlock)
            for channel in [0..block.out_height * block.out_width * block.channels; 1024 a core] {
                filled inputs: f32,
                write outputs: f32,
            }
            /// Enlarged images: writes some channels of the output image. An element is an input channel of an output
            /// pixel.
            Upsample upsample(block: UpsampleBlock)
            for channel in [0..block.out_height * block.out_width * block.in_channels; 4096 a core] {
                filled inputs: f32,
                write outputs[block.place(channel as usize)]: f32,
            }
            /// Linear layers (a matrix product with bias, residual and rectification), summed in an order of the
            /// device's choice. An element is an 8x8 part of a tile of `TILE` rows and columns.
            Linear linear(block: LinearBlock) tiles [block.row_count, block.inner_count, block.column_count], twin {
                filled inputs: f32,
                layer weights: f32,
                filled bias: f32,
                optional residual: f32 = bias if !block.has_residual,
                write outputs: f32,
            }
            /// Means of an image's channels, from `inputs[pixel][channel]`. An element is a channel.
            ChannelMeans channel_means(block: MeanBlock) for channel in [0..block.channels; 16 a core] {
                filled inputs: f32,
                write means: f32,
            }
            /// Group-norm statistics of parts of an image, mean and squared deviations: `partials[part][group]`. An
            /// element is a group of channels in a part.
            GroupNormPartials group_norm_partials(block: GroupNormBlock)
            for group in [0..block.part_count() * block.group_count], together, twin {
                filled inputs: f32,
                write partials: [f32; 2],
            }
            /// Group norm from the statistics of an image's parts: `outputs[pixel][channel]`, with `weights[channel]`
            /// and `bias[channel]`. An element is a run of 4096 outputs (`group_norm::RUN`).
            GroupNorm group_norm(block: GroupNormBlock) for run in [0..block.run_count()], together, twin {
                filled inputs: f32,
                filled partials: [f32; 2],
                filled weights: f32,
                filled bias: f32,
                write outputs: f32,
            }
            /// Products of two computed matrices, which may lie in one buffer, summed in an order of the device's
            /// choice. An element is an 8x8 part of a tile of `TILE` rows and columns.
            MatrixProduct matrix_product(block: MatrixBlock)
            tiles [block.row_count, block.inner_count, block.column_count], twin {
                filled left: f32,
                filled right: f32,
                write outputs: f32,
            }
            /// Softmax over rows: `weights[row][column]` from `scores[row][column]`. An element is a row.
            SoftmaxRows softmax_rows(column_count: u32; row_count) for row in [0..row_count], together, looped {
                filled scores: f32,
                write weights: f32,
            }
            /// Weighted sums over views: `fused[element]` from the weights of the element's point and
            /// `latents[view][element]`. An element is a channel of a point.
            FuseViews fuse_views(block: FuseBlock; element_count) for channel in [0..element_count; 16384 a core] {
                read weights: f32,
                read latents: f32,
                write fused: f32,
            }
            /// Colour and optical depth of points: each point's sample of `samples[ray][sample]` (red, green, blue,
            /// optical depth), from `raw[point][4]`. An element is a point.
            Radiance radiance(; point_count) for point in [0..point_count], serial {
                read raw: f32,
                read points: RayPoint as vectors,
                write samples: [f32; 4],
            }
            /// Pixels from the samples on their rays: `colours[ray]` (red, green, blue, opacity) and `depths[ray]`,
            /// from `samples[ray][sample]` (red, green, blue, optical depth) and `sample_depths[ray][sample]`. An
            /// element is a ray.
            Composite composite(block: CompositeBlock; ray_count) for ray in [0..ray_count; 64 a core] {
                read samples: [f32; 4],
                read sample_depths: f32,
                write colours: [f32; 4],
                write depths: f32,
            }
            /// Weights of samples on rays: `seen[first ray + ray][sample]` is weight and transmittance in front, from
            /// `samples[ray][sample]` (red, green, blue, optical depth). An element is a ray.
            WeighSamples weigh_samples(block: RaysBlock; ray_count) for ray in [0..ray_count; 32 a core] {
                read samples: [f32; 4],
                write seen[(block.first_ray + ray) * block.sample_count]: [f32; 2],
            }
            /// Random numbers for fine samples: `draws[ray][sample]`. An element is a fine sample.
            RandomDraws random_draws(block: FineBlock; ray_count)
            for sample in [0..ray_count * block.fine_count(); 1024 a core] {
                read pixels: u32,
                write draws: [f32; 2],
            }
            /// Depths where a first pass saw something: `depths[ray][sample]`, from `seen[ray][part]` and the pixels of
            /// these rays. An element is a fine sample.
            FineDepths fine_depths(block: FineBlock; ray_count)
            for sample in [0..ray_count * block.fine_count(); 1024 a core] {
                read seen: [f32; 2],
                read rays: TargetRay,
                read colours: [f32; 4],
                read pixel_depths: f32,
                read draws: [f32; 2],
                write depths: f32,
            }
            /// Depths of two passes in order: `merged[ray][sample]` increase, from `coarse[ray][sample]` and
            /// `fine[ray][sample]`. An element is a sample of either.
            MergeDepths merge_depths(block: FineBlock; ray_count)
            for sample in [0..ray_count * (block.coarse_count + block.fine_count())], looped {
                read coarse: f32,
                read fine: f32,
                write merged: f32,
            }
            /// The sample mask, which samples are computed: `mask[ray][sample]` is 1 or 0, by `seen[seen ray][part]`.
            /// An element is a sample.
            SampleMask sample_mask(block: SampleMaskBlock; ray_count)
            for sample in [0..ray_count * block.sample_count; 1024 a core] {
                read seen: [f32; 2],
                read rays: TargetRay,
                read pixels: u32,
                read depths: f32,
                write mask: u32,
            }
            /// How many elements of each run of 256 (`compact::RUN`) a mask marks: `counts[run]` of
            /// `mask[element]`. An element is a run.
            CountMarked count_marked(element_count: u32) for run in [0..element_count.div_ceil(RUN); 64 a core] {
                read mask: u32,
                write counts: u32,
            }
            /// Where each run's part of a list begins, `offsets[run]`, with one run more than `counts[run]`, and the
            /// length of it all, `total[0]`. There is one element.
            SumCounts sum_counts(run_count: u32) for all in [0..1], serial {
                read counts: u32,
                write offsets: u32,
                write total: u32,
            }
            /// What a mask marks, in order: `list[place]`. An element is a run.
            ListMarked list_marked(element_count: u32) for run in [0..element_count.div_ceil(RUN)], serial {
                read mask: u32,
                read offsets: u32,
                write list: u32,
            }
            /// Where numbers are not finite: `firsts[run]` is the index of the first infinite or NaN number of a run of
            /// 256 (`finite::FINITE_RUN`), or `u32::MAX`. An element is a run.
            FindNonFinite find_non_finite(value_count: u32)
                for run in [0..value_count.div_ceil(FINITE_RUN); 256 a core] {
                read values: f32,
                write firsts: u32,
            }
            /// Weights of samples on rays of features: `weights[ray][sample]` from `raw[ray][sample][1 + feature]`. An
            /// element is a ray.
            WeighFeatures weigh_features(block: FeatureBlock; ray_count) for ray in [0..ray_count; 16 a core] {
                read raw: f32,
                read points: RayPoint,
                write weights[ray * block.sample_count]: f32,
            }
            /// Sums of features along rays: `summed[first ray + ray][feature]`. An element is a feature of a ray.
            SumFeatures sum_features(block: FeatureBlock; ray_count)
                for feature in [0..ray_count * block.feature_count], twin {
                read weights: f32,
                read fused: f32,
                read raw: f32,
                write summed: f32,
            }
            /// What the denoiser is given: `inputs[pixel][channel]`. An element is a channel of a pixel.
            DenoiserInput denoiser_input(block: DenoiserInputBlock; pixel_count)
            for channel in [0..pixel_count * (block.picture_channels + block.condition_channels); 16384 a core] {
                read noisy: f32,
                read condition: f32,
                write inputs: f32,
            }
            /// Where the rays of one view's pixels enter the visual hull: the view's part of
            /// `entries[view][row][column]`. An element is a pixel of the view.
            HullEntry hull_entry(view: u32; pixel_count) for pixel in [0..pixel_count; 64 a core] {
                one object: ObjectBlock,
                read views: CameraBlock as vectors,
                paged texels: [f32; 4],
                write_paged entries[views[*view as usize].first_texel + pixel]: f32,
            }
            /// How badly other views match, at all planes: `costs[row][column][plane]` of a band. An element is a pixel
            /// of the band.
            MatchCost match_cost(block: SweepBlock) for pixel in [0..block.row_count * block.width; 16 a core] {
                one object: ObjectBlock,
                read views: CameraBlock as vectors,
                paged texels: [f32; 4] as vectors,
                paged entries: f32,
                read pair_weights: f32,
                write costs[pixel * block.plane_count]: f32,
            }
            /// Costs summed over a window's columns: `row_sums[row][column][plane]` = sum, count. An element is a plane
            /// of a pixel of the band.
            SumRow sum_row(block: SweepBlock)
            for plane in [0..block.row_count * block.width * block.plane_count; 4096 a core] {
                read costs: f32,
                write row_sums: [f32; 2],
            }
            /// Costs averaged over a window: `means[row][column][plane]`. An element is a plane of a pixel of the band.
            MeanColumn mean_column(block: SweepBlock)
            for plane in [0..block.row_count * block.width * block.plane_count; 4096 a core] {
                read costs: f32,
                read row_sums: [f32; 2],
                write means: f32,
            }
            /// Depths of least cost, in some rows of a band, counted from its first: their part of
            /// `picked[view][row][column]`. An element is a pixel of the band.
            PickDepth pick_depth(block: SweepBlock; first_row, row_count)
            for pixel in [first_row * block.width..(first_row + row_count) * block.width; 64 a core] {
                one object: ObjectBlock,
                read views: CameraBlock as vectors,
                read means: f32,
                paged entries: f32,
                paged guess: f32,
                write_paged picked[views[block.view as usize].first_texel + block.first_row * block.width + pixel]: f32,
            }
            /// Rays through the solid, for some rows of a target: `colours[row][column]` (red, green, blue, opacity)
            /// and `pixel_depths[row][column]`. An element is a pixel of the target.
            MarchRays march_rays(block: MarchBlock; first_row, row_count)
            for pixel in [first_row * block.target.width..(first_row + row_count) * block.target.width; 16 a core] {
                one object: ObjectBlock,
                read views: CameraBlock as vectors,
                read footprints: f32,
                paged texels: [f32; 4] as vectors,
                paged depths: f32,
                read weights: f32,
                write_paged colours: [f32; 4] as vectors,
                write_paged pixel_depths: f32,
            }
            /// What views show on planes, and how far their colours agree: `grey[view][row][column][group]` and
            /// `evidence[row][column][group][4]` of a band of a frustum. An element is a group of planes of a pixel.
            CompareViews compare_views(block: FrustumBlock)
            for group in [0..block.row_count * block.camera.width * block.group_count], twin {
                read views: SweptView as vectors,
                read pairs: ViewPair,
                read texels: [f32; 4] as vectors,
                read disparities: [f32; 2] as vectors,
                write grey: Planes as vectors,
                write evidence: Planes as vectors,
            }
            /// Costs of planes by colour and census, in some rows of a band, counted from its first: their part of
            /// `costs[row][column][group][cost times weight, weight]`. An element is a group of planes of a pixel.
            CensusCost census_cost(block: FrustumBlock; first_row, row_count)
            for group in [first_row * block.camera.width * block.group_count ..
                (first_row + row_count) * block.camera.width * block.group_count; 128 a core], twin {
                read pairs: ViewPair,
                read grey: Planes,
                read evidence: Planes,
                write costs[2 * (block.first_row * block.camera.width * block.group_count + group)]: Planes,
            }
            /// Costs summed over rows of three windows: `sums[row][column][group][window][2]`. An element is a group of
            /// planes of a pixel.
            RowSums row_sums(block: WindowBlock)
            for group in [0..block.width * block.height * block.group_count; 128 a core], wide {
                read costs: Planes,
                write sums[6 * group]: Planes,
            }
            /// Costs averaged over three windows: `means[row][column][group]`. An element is a group of planes of a
            /// pixel.
            WindowCost window_cost(block: WindowBlock)
            for group in [0..block.width * block.height * block.group_count; 1024 a core], twin {
                read sums: Planes,
                write means: Planes,
            }
            /// How opaque planes are by the views' own disparities: `opacities[row][column][group]`. An element is a
            /// group of planes of a pixel.
            PlaneOpacity plane_opacity(block: FrustumBlock)
            for group in [0..block.camera.width * block.camera.height * block.group_count; 128 a core], twin {
                read views: SweptView as vectors,
                read disparities: [f32; 2] as vectors,
                write opacities: Planes as vectors,
            }
            /// Costs with a preference for the first opaque plane of each ray: `costs[row][column][group]`. An element
            /// is a pixel.
            FrontCost front_cost(block: FrontBlock)
            for pixel in [0..block.width * block.height; 64 a core], wide {
                read opacities: Planes as vectors,
                read means: Planes as vectors,
                write costs[block.group_count * pixel]: Planes as vectors,
            }
            /// Costs joined along lines in four directions: `paths[direction][line][step][group]`. An element are
            /// 8 lines.
            FollowPaths follow_paths(block: CostBlock)
            for lines in [0..block.line_count().div_ceil(8); 1 a core], together, wide {
                filled means: Planes as vectors,
                write paths[block.first_of_line(8 * lines)]: Planes as vectors,
            }
            /// The mean of the four directions' costs: `costs[row][column][group]`. An element is a group of planes of
            /// a pixel.
            JoinPaths join_paths(block: CostBlock)
            for group in [0..block.width * block.height * block.group_count; 1024 a core], wide {
                read paths: Planes,
                write costs: Planes,
            }
            /// Disparity and confidence of a view's pixels: the view's part of `disparities[view][row][column]`. An
            /// element is a pixel.
            PickDisparity pick_disparity(block: FrustumBlock)
            for pixel in [0..block.camera.width * block.camera.height; 64 a core], wide {
                read costs: Planes,
                write disparities[block.camera.first_texel + pixel]: [f32; 2],
            }
            /// Disparity and confidence of a view's pixels by what other views say of them: the view's part of
            /// `confirmed[view][row][column]`. An element is a pixel.
            ConfirmDisparities confirm_disparities(block: ConfirmBlock)
            for pixel in [0..block.camera.width * block.camera.height; 256 a core] {
                read others: SweptView as vectors,
                read disparities: [f32; 2] as vectors,
                write confirmed[block.camera.first_texel + pixel]: [f32; 2],
            }
            /// Pixels blended from planes, for some rows of a target: `colours[row][column]` (red, green, blue,
            /// opacity), `pixel_depths[row][column]` and `confidences[row][column]`. An element is a pixel of the
            /// target.
            BlendPlanes blend_planes(block: BlendBlock; first_row, row_count)
            for pixel in [first_row * block.target.width..(first_row + row_count) * block.target.width; 64 a core],
                twin {
                read views: SweptView as vectors,
                paged texels: [f32; 4] as vectors,
                read disparities: [f32; 2] as vectors,
                read costs: Planes as vectors,
                write_paged colours: [f32; 4] as vectors,
                write pixel_depths: f32,
                write confidences: f32,
            }
            /// Gaussians as a camera sees them. An element is a Gaussian.
            ProjectGaussians project_gaussians(block: SplatBlock)
                for gaussian in [0..block.gaussian_count; 128 a core] {
                read gaussians: GaussianBlock as vectors,
                write splats: ProjectedGaussian as vectors,
            }
            /// Pixels from the splats of their tile, which the list `entries[starts[tile]..starts[tile + 1]]` numbers
            /// front to back: `colours[row][column]` (red, green, blue over the background, opacity) and
            /// `depths[row][column]`, weighted sums. An element is a tile.
            BlendSplats blend_splats(block: TileBlock) for tile in [0..block.tile_count(); 1 a core], together, twin {
                filled starts: u32,
                filled entries: u32,
                filled splats: ProjectedGaussian as vectors,
                write colours: [f32; 4] as vectors,
                write depths: f32,
            }
            /// Pixels as they are shown, `shown[row][column]`: red, green, blue and opacity in 255ths, red in the
            /// lowest byte; and `surfaces[row][column]`, depths from `depths`, weighted sums, 0 where the opacity is
            /// less than this. An element is a pixel.
            ShowPixels show_pixels(least_opacity: f32; pixel_count) for pixel in [0..pixel_count; 1024 a core] {
                read colours: [f32; 4] as vectors,
                read depths: f32,
                write shown: u32,
                write surfaces: f32,
            }
            /// What the pixels of a tile say of each splat of its list: `sums[entry]`, from the derivatives of a loss
            /// by the pixels, `gradients[row][column]` (by red, green, blue and opacity). An element is a tile.
            BlendGradient blend_gradient(block: TileBlock)
                for tile in [0..block.tile_count(); 1 a core], together, wide {
                filled starts: u32,
                filled entries: u32,
                filled splats: ProjectedGaussian as vectors,
                filled colours: [f32; 4] as vectors,
                filled gradients: [f32; 4] as vectors,
                write sums[starts[tile as usize]]: SplatGradient as vectors,
            }
            /// Derivatives by the Gaussians' parameters, in the places of these: `gradients[gaussian]`, from the
            /// entries of the tiles' lists that are the Gaussian's, `uses[use_starts[gaussian]..use_starts[gaussian +
            /// 1]]`. An element is a Gaussian.
            ProjectGradients project_gradients(block: SplatBlock)
                for gaussian in [0..block.gaussian_count; 128 a core] {
                read gaussians: GaussianBlock as vectors,
                read splats: ProjectedGaussian as vectors,
                read use_starts: u32,
                read uses: u32,
                read sums: SplatGradient as vectors,
                write gradients: GaussianBlock as vectors,
            }
            /// Gaussians whose colours depend on the direction, as a camera sees them: `terms[gaussian][term]` are
            /// their spherical harmonics, of which states say how many there are so far. An element is a Gaussian.
            ProjectParticles project_particles(block: ParticleBlock)
            for gaussian in [0..block.gaussian_count; 128 a core] {
                read gaussians: GaussianBlock as vectors,
                paged terms: HarmonicTerm as vectors,
                optional states: ParticleState as vectors = gaussians if !block.has_states,
                write splats: ProjectedGaussian as vectors,
            }
            /// Which splats' boxes reach each bin of 8 by 8 tiles: `masks[bin][mask]`, 32 splats a mask. An element is
            /// a mask of a bin.
            MarkBins mark_bins(block: ListBlock) for mask in [0..block.bin_count() * block.mask_count(); 64 a core] {
                read splats: ProjectedGaussian as vectors,
                write masks: u32,
            }
            /// How many splats each tile shows, in parts of the splats: `counts[bin][part][tile]`, 64 tiles a bin. An
            /// element is a part of a bin.
            CountEntries count_entries(block: ListBlock) for piece in [0..block.piece_count(); 1 a core], together {
                filled splats: ProjectedGaussian as vectors,
                filled masks: u32,
                write counts[64 * piece]: u32,
            }
            /// Entries of a tile before each part, `before[run][part][tile]`, and of a run up to each tile and with it,
            /// `sums[run][tile]`: a run are the 8 tiles of a bin in a row. An element is a run.
            SumEntries sum_entries(block: ListBlock) for run in [0..block.run_count(); 16 a core], together {
                filled counts: u32,
                write before[block.before_at(run, 0, 0)]: u32,
                write sums[8 * run]: u32,
            }
            /// Where each tile's list begins, `starts[tile]`, with one tile more, and the status after this picture. If
            /// there are more entries than the capacity, or were before, all lists are empty. An element are 8 runs.
            StartTiles start_tiles(block: ListBlock) for element in [0..block.start_count(); 16 a core], together {
                filled sums: u32,
                filled status: u32,
                write starts[block.place_of_start(element)]: u32,
                write next_status[block.place_of_status(element)]: u32,
            }
            /// The splats that each tile shows, in the order of their indices: `keys[starts[tile]..starts[tile + 1]]`,
            /// the bits of their depths and their indices. An element is a part of a bin.
            ListEntries list_entries(block: ListBlock) for piece in [0..block.piece_count()], together, serial {
                filled splats: ProjectedGaussian as vectors,
                filled masks: u32,
                filled starts: u32,
                filled before: u32,
                write keys: [u32; 2],
            }
            /// The lists that `blend_splats` takes: each tile's keys by depth, and of one depth by index,
            /// `entries[starts[tile]..starts[tile + 1]]`. An element is an entry; behind the last one nothing is
            /// written.
            SortEntries sort_entries(block: ListBlock) for entry in [0..block.capacity], looped {
                read starts: u32,
                read keys: [u32; 2],
                write entries: u32,
            }
            /// Means and variances of a photograph's windows: its part of `means[row][column]` and
            /// `variances[row][column]` of several photographs (red, green, blue, 0). An element is a pixel.
            MeasureWindows measure_windows(block: LossBlock)
            for pixel in [0..block.width * block.height; 16 a core] {
                read photographs: [f32; 4] as vectors,
                write means[block.first + pixel]: [f32; 4] as vectors,
                write variances[block.first + pixel]: [f32; 4] as vectors,
            }
            /// Derivatives of `1 - SSIM` of a picture and a photograph by the means of windows:
            /// `by_windows[row][column]` (by those of x, x x and x y; red, green, blue). `photographs`, `means` and
            /// `variances` are of several photographs. An element is a pixel.
            CompareWindows compare_windows(block: LossBlock)
            for pixel in [0..block.width * block.height; 16 a core] {
                read colours: [f32; 4] as vectors,
                read photographs: [f32; 4] as vectors,
                read means: [f32; 4] as vectors,
                read variances: [f32; 4] as vectors,
                read gains: GainBlock,
                write by_windows[3 * pixel]: [f32; 4] as vectors,
            }
            /// Derivatives of a loss by the pixels, `by_pixels[row][column]` (by red, green, blue and opacity), and
            /// what they add to that by the photograph's gain, `shares[row][column]`. An element is a pixel.
            ComparePixels compare_pixels(block: LossBlock)
            for pixel in [0..block.width * block.height; 16 a core] {
                read colours: [f32; 4] as vectors,
                read photographs: [f32; 4] as vectors,
                read by_windows: [f32; 4] as vectors,
                read gains: GainBlock,
                write by_pixels: [f32; 4] as vectors,
                write shares: [f32; 4] as vectors,
            }
            /// Derivatives by the Gaussians' parameters, in the places of these, from the entries of the tiles' lists:
            /// as `project_gradients`, which has the entries of each Gaussian listed. An element is a Gaussian.
            GatherGradients gather_gradients(block: SplatBlock) for gaussian in [0..block.gaussian_count; 64 a core] {
                read gaussians: GaussianBlock as vectors,
                read splats: ProjectedGaussian as vectors,
                read starts: u32,
                read entries: u32,
                read sums: SplatGradient as vectors,
                write gradients: GaussianBlock as vectors,
            }
            /// Gaussians after a step against the derivatives. An element is a Gaussian.
            StepParticles step_particles(block: StepBlock) for gaussian in [0..block.gaussian_count(); 128 a core] {
                read gaussians: GaussianBlock as vectors,
                read states: ParticleState as vectors,
                read splats: ProjectedGaussian as vectors,
                read gradients: GaussianBlock as vectors,
                read status: u32,
                write next_gaussians: GaussianBlock as vectors,
                write next_states: ParticleState as vectors,
            }
            /// Spherical harmonics and their states after a step against the derivatives: `next_terms[gaussian][term]`.
            /// An element is a term.
            StepHarmonics step_harmonics(block: StepBlock)
            for term in [0..block.gaussian_count() * block.term_count(); 256 a core] {
                read gaussians: GaussianBlock as vectors,
                read states: ParticleState as vectors,
                read splats: ProjectedGaussian as vectors,
                read gradients: GaussianBlock as vectors,
                read status: u32,
                read terms: HarmonicTerm as vectors,
                read term_states: TermState as vectors,
                write next_terms: HarmonicTerm as vectors,
                write next_term_states: TermState as vectors,
            }
            /// What runs of 256 pixels add to the derivative by a gain: `sums[run]`. An element is a run.
            SumShares sum_shares(pixel_count: u32)
            for run in [0..pixel_count.div_ceil(SHARE_RUN); 64 a core], together {
                filled shares: [f32; 4] as vectors,
                write sums: [f32; 4] as vectors,
            }
            /// The photographs' gains after a step of one of them; their mean is 1. An element is a photograph.
            StepGains step_gains(block: GainStepBlock) for gain in [0..block.gain_count; 64 a core] {
                read sums: [f32; 4] as vectors,
                read status: u32,
                read gains: GainBlock,
                write next_gains: GainBlock,
            }
            /// Linear combinations of pictures: `mixed[element]` of `state[element]` and four results, the newest
            /// first. What has coefficient 0 is not read and may be any buffer. An element is a channel of a pixel.
            MixPictures mix_pictures(block: Mix; element_count) for channel in [0..element_count; 4096 a core] {
                read state: f32,
                read newest: f32,
                read second: f32,
                read third: f32,
                read fourth: f32,
                write mixed: f32,
            }
            /// Pictures with noise. An element is a channel of a pixel.
            AddNoise add_noise(block: NoiseBlock; element_count) for channel in [0..element_count; 4096 a core] {
                read picture: f32,
                write noisy: f32,
            }
            /// Numbers copied, to measure how fast a device reads and writes. An element is four numbers.
            CopyNumbers copy_numbers(; element_count) for four in [0..element_count], twin, measured {
                read numbers: [f32; 4] as vectors,
                write copies: [f32; 4] as vectors,
            }
            /// Numbers multiplied and added to, to measure how fast a device computes: `ends[element]` from
            /// `starts[element]`. An element is several chains.
            MultiplyAdd multiply_add(block: ChainBlock; element_count) for chain in [0..element_count], twin, measured {
                read starts: f32,
                write ends: f32,
            }
            /// A product of two matrices that is added again and again, to measure how fast a device's matrix units are.
            /// An element is an 8x8 part of a tile of `TILE` rows and columns.
            RepeatProduct repeat_product(block: RepeatedBlock)
            tiles [block.row_count, block.inner_count(), block.column_count], twin, measured {
                filled left: f32,
                filled right: f32,
                write sums: f32,
            }
            /// Texels looked up, to measure how fast a device does that: `sums[element]`. An element is several
            /// look-ups.
            LookUpTexels look_up_texels(block: LookUpBlock; element_count)
            for element in [0..element_count; 1024 a core], measured, wide {
                read texels: [f32; 4] as vectors,
                write sums: f32,
            }
        }
    };
}
